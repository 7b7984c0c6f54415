"""Simulated plants, the actuators that drive them and the sensors that see them.

A plant is a link of the bench: its actuator and its sensors name it under `link`.
"""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.devices import Actuator, Link, Load, Sensor
from labdrive_sim.actuators import SpindleActuator, WalkingActuator
from labdrive_sim.encoder import Encoder
from labdrive_sim.faulty import FaultyInterferometer
from labdrive_sim.force import ForceSensor
from labdrive_sim.interferometer import Interferometer
from labdrive_sim.load import SimLoad
from labdrive_sim.spindle import Spindle
from labdrive_sim.thermometer import Thermometer
from labdrive_sim.walking_drive import WalkingDrive


@hookimpl
def labdrive_links() -> Mapping[str, type[Link]]:
    """Return the plants."""
    return {"sim-walking-drive": WalkingDrive, "sim-spindle": Spindle}


@hookimpl
def labdrive_actuators() -> Mapping[str, type[Actuator]]:
    """Return the actuators that play tables to a plant."""
    return {"sim-walking-actuator": WalkingActuator, "sim-spindle-actuator": SpindleActuator}


@hookimpl
def labdrive_sensors() -> Mapping[str, type[Sensor]]:
    """Return the sensors that see a plant."""
    return {
        "sim-interferometer": Interferometer,
        "sim-faulty-interferometer": FaultyInterferometer,
        "sim-encoder": Encoder,
        "sim-force": ForceSensor,
        "sim-thermometer": Thermometer,
    }


@hookimpl
def labdrive_loads() -> Mapping[str, type[Load]]:
    """Return the load that a plant can bear."""
    return {"sim-load": SimLoad}
