"""Spindle drives: lead screws with motors, commanded by an angle, over CANopen and Modbus."""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.devices import Actuator, Link, Sensor
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_actuator import CanopenSpindle
from labdrive_spindle.canopen_sensors import CanopenDriveSensor, CanopenEncoder


@hookimpl
def labdrive_links() -> Mapping[str, type[Link]]:
    """Return the buses."""
    return {"can-bus": CanBus}


@hookimpl
def labdrive_actuators() -> Mapping[str, type[Actuator]]:
    """Return the drives."""
    return {"spindle-canopen": CanopenSpindle}


@hookimpl
def labdrive_sensors() -> Mapping[str, type[Sensor]]:
    """Return the sensors on the same buses."""
    return {"canopen-encoder": CanopenEncoder, "canopen-drive": CanopenDriveSensor}
