"""Recordings made elsewhere, played as if they came from a bench."""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.devices import Actuator, Sensor
from labdrive_recording.actuator import RecordedActuator
from labdrive_recording.sensor import RecordedSensor


@hookimpl
def labdrive_actuators() -> Mapping[str, type[Actuator]]:
    """Return what plays the phases of a recording."""
    return {"recording": RecordedActuator}


@hookimpl
def labdrive_sensors() -> Mapping[str, type[Sensor]]:
    """Return what plays the readings of a recording."""
    return {"recording": RecordedSensor}
