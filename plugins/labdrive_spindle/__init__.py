"""Spindle drives: lead screws with motors, commanded by an angle, over CANopen and Modbus."""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.devices import Actuator, Link, Load, Sensor
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_actuator import CanopenSpindle
from labdrive_spindle.canopen_sensors import CanopenDriveSensor, CanopenEncoder
from labdrive_spindle.modbus_actuator import ModbusSpindle
from labdrive_spindle.modbus_bus import ModbusBus
from labdrive_spindle.modbus_sensor import ModbusRegister
from labdrive_spindle.stage_load import CanopenStageLoad, ModbusStageLoad


@hookimpl
def labdrive_links() -> Mapping[str, type[Link]]:
    """Return the buses."""
    return {"can-bus": CanBus, "modbus": ModbusBus}


@hookimpl
def labdrive_actuators() -> Mapping[str, type[Actuator]]:
    """Return the drives."""
    return {"spindle-canopen": CanopenSpindle, "spindle-modbus": ModbusSpindle}


@hookimpl
def labdrive_sensors() -> Mapping[str, type[Sensor]]:
    """Return the sensors on the same buses."""
    return {
        "canopen-encoder": CanopenEncoder,
        "canopen-drive": CanopenDriveSensor,
        "modbus-register": ModbusRegister,
    }


@hookimpl
def labdrive_loads() -> Mapping[str, type[Load]]:
    """Return motorized stages that press a spring."""
    return {"stage-canopen": CanopenStageLoad, "stage-modbus": ModbusStageLoad}
