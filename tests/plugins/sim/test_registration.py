"""The plugin is found, under its names, and costs nothing until something moves."""

import subprocess
import sys

from labdrive.engine.discovery import discover

WITHOUT_MOVING = """
import sys
from labdrive_sim import labdrive_actuators, labdrive_links, labdrive_sensors
from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.limits import Limits, VoltageRange
from labdrive.interfaces.waveform import Waveform
limits = Limits(voltage=VoltageRange(min="0 V", max="48 V"))
drive = labdrive_links()["sim-walking-drive"]
plant = drive(drive.Settings(), DeviceContext("plant", limits))
generator = labdrive_actuators()["sim-walking-actuator"]
context = DeviceContext("lt40", limits, {"plant": plant})
actuator = generator(generator.Settings(link="plant"), context)
actuator.nominal_table(Waveform(trajectory="ellipse"))
actuator.make_safe()
labdrive_sensors()["sim-force"]
print(*(name for name in ("numba", "scipy", "matplotlib") if name in sys.modules))
"""


def test_it_is_found_under_the_names_that_benches_use():
    plugins = discover().plugins
    assert {"sim-walking-drive", "sim-spindle"} <= set(plugins.links)
    assert {"sim-walking-actuator", "sim-spindle-actuator"} <= set(plugins.actuators)
    assert {"sim-interferometer", "sim-encoder", "sim-force"} <= set(plugins.sensors)


def test_until_something_moves_nothing_slow_is_imported():
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_MOVING], capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == ""
