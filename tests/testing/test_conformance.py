"""Every bundled device conforms, and the checks notice a device that does not."""

from pathlib import Path

import numpy as np
import pytest

from labdrive.engine.devices import build
from labdrive.engine.discovery import discover
from labdrive.interfaces.devices import Reading, Samples
from labdrive.interfaces.waveform import Waveform
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN
from labdrive.recipe.load import load_bench
from labdrive.testing import check_actuator, check_sensor

RECIPES = Path(__file__).parents[2] / "recipes"
BENCHES = ["lt40-sim.yaml", "spindle-sim.yaml", "odrive-recording.yaml"]
# Checked on emulated drives, in tests/plugins/spindle.
CHECKED_THERE = ["spindle-canopen.yaml", "spindle-modbus.yaml"]
MORE = """\
links: {plant: {plugin: sim-walking-drive}}
actuators: {lt40: {plugin: sim-walking-actuator, link: plant, table_length: 512}}
sensors:
  encoder: {plugin: sim-encoder, link: plant}
  polled: {plugin: sim-interferometer, link: plant, sampling: polled}
  faulty: {plugin: sim-faulty-interferometer, link: plant}
  temperature: {plugin: sim-thermometer}
limits: {voltage: {min: 0 V, max: 48 V}}
"""
MOTION = Motion(periods=3, samples_per_period=32, period_rate_hz=5.0, settle_periods=1)


@pytest.fixture(scope="module")
def plugins():
    return discover().plugins


@pytest.fixture(params=[*BENCHES, "more.yaml"])
def bench(request, plugins, tmp_path):
    """Build a bench afresh, its links connected; give its settings and its devices."""
    path = RECIPES / "benches" / request.param
    if request.param == "more.yaml":
        path = tmp_path / "more.yaml"
        path.write_text(MORE)
    settings = load_bench(path, plugins)
    devices = build(settings, plugins, next(iter(settings.actuators)), 1, path.parent)
    for link in devices.links.values():
        link.connect()
    return settings, devices


def waveform_for(devices):
    unit = devices.limits.voltage
    return Waveform(trajectory="box") if unit is not None else None


def test_actuators_conform(bench):
    _, devices = bench
    motion = devices.fixed_motion or MOTION
    check_actuator(devices.actuator, waveform_for(devices), motion)


def test_sensors_conform(bench):
    _, devices = bench
    motion = devices.fixed_motion or MOTION
    for sensor in devices.sensors.values():
        check_sensor(sensor, devices.actuator, waveform_for(devices), motion)


def test_no_bundled_device_goes_unchecked(plugins, tmp_path):
    (tmp_path / "more.yaml").write_text(MORE)
    shipped = [RECIPES / "benches" / name for name in (*BENCHES, *CHECKED_THERE)]
    paths = [*shipped, tmp_path / "more.yaml"]
    used = {"actuators": set(), "sensors": set(), "links": set()}
    for path in paths:
        settings = load_bench(path, plugins)
        for role, names in used.items():
            names |= {device.plugin for device in getattr(settings, role).values()}
    for role, names in used.items():
        assert names == set(plugins.role(role))


class Faulty:
    """Wraps a device and spoils what it gives."""

    def __init__(self, device, **spoiled):
        self._device = device
        self._spoiled = spoiled

    def __getattr__(self, name):
        return self._spoiled.get(name) or getattr(self._device, name)


@pytest.fixture
def drive(plugins):
    path = RECIPES / "benches" / "spindle-sim.yaml"
    return build(load_bench(path, plugins), plugins, "spindle", 1, path.parent)


def late(actuator):
    def play(acquisition):
        for samples in actuator.play(acquisition):
            yield Samples(samples.phase + 0.01, samples.time, samples.settling)

    return play


def short(actuator):
    def play(acquisition):
        yield from list(actuator.play(acquisition))[:-1]

    return play


@pytest.mark.parametrize(("spoil", "said"), [(late, "equidistant"), (short, "samples are due")])
def test_an_actuator_off_the_grid_is_noticed(drive, spoil, said):
    faulty = Faulty(drive.actuator, play=spoil(drive.actuator))
    with pytest.raises(AssertionError, match=said):
        check_actuator(faulty, None, MOTION)


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (lambda s: Reading(np.full(len(s.time), np.nan), s.time), "finite"),
        (lambda s: Reading(s.time[1:], s.time[1:]), "once a sample"),
        (lambda s: Reading(s.time, s.time + TURN), "at its time"),
    ],
)
def test_a_sensor_that_loses_or_spoils_readings_is_noticed(drive, read, said):
    faulty = Faulty(drive.sensors["encoder"], read=read)
    with pytest.raises(AssertionError, match=said):
        check_sensor(faulty, drive.actuator, None, MOTION)
