"""Simulated benches, put together by hand and played without the engine."""

from dataclasses import dataclass, field

import numpy as np
import pytest

import labdrive_sim
from labdrive.interfaces.devices import Acquisition, DeviceContext
from labdrive.interfaces.limits import Limits, VoltageRange
from labdrive.interfaces.waveform import Waveform
from labdrive.model.motion import Motion

QUIET_SENSOR = {"noise": "0 nm", "walk": "0 nm/sqrt(s)"}


@dataclass
class Bench:
    """One plant, one actuator, one sensor; `seed` is the run's."""

    plant: dict
    actuator: dict
    sensor: dict
    seed: int = 0
    limits: Limits = field(
        default_factory=lambda: Limits(voltage=VoltageRange.model_construct(min=0.0, max=48.0))
    )

    def __post_init__(self):
        self.link = self._make(labdrive_sim.labdrive_links(), self.plant, "plant", {})
        links = {"plant": self.link}
        self.drive = self._make(labdrive_sim.labdrive_actuators(), self.actuator, "drive", links)
        self.probe = self._make(labdrive_sim.labdrive_sensors(), self.sensor, "probe", links)

    def _make(self, classes, settings, name, links):
        keys = {key: value for key, value in settings.items() if key != "plugin"}
        cls = classes[settings["plugin"]]
        context = DeviceContext(name, self.limits, links, self.seed)
        return cls(cls.Settings.model_validate(keys), context)

    def table(self, trajectory="box", **scales):
        return self.drive.nominal_table(Waveform(trajectory=trajectory, **scales))

    def play(self, motion, number=1):
        """Play the loaded table; yield samples and reading of each chunk."""
        acquisition = Acquisition(number, motion)
        self.probe.arm(acquisition)
        for samples in self.drive.play(acquisition):
            reading = self.probe.read(samples)
            yield samples, reading

    def record(self, table, motion, number=1):
        """Return phase, time and value of all recorded samples."""
        self.drive.load(table)
        chunks = [chunk for chunk in self.play(motion, number) if not chunk[0].settling]
        return (
            np.concatenate([samples.phase for samples, _ in chunks]),
            np.concatenate([reading.time for _, reading in chunks]),
            np.concatenate([reading.value for _, reading in chunks]),
        )


def walking_bench(plant=None, actuator=None, sensor=None, seed=0):
    return Bench(
        {"plugin": "sim-walking-drive"} | (plant or {}),
        {"plugin": "sim-walking-actuator", "link": "plant"} | (actuator or {}),
        {"plugin": "sim-interferometer", "link": "plant"} | (sensor or QUIET_SENSOR),
        seed,
    )


def spindle_bench(plant=None, actuator=None, sensor=None, seed=0):
    return Bench(
        {"plugin": "sim-spindle"} | (plant or {}),
        {"plugin": "sim-spindle-actuator", "link": "plant"} | (actuator or {}),
        {"plugin": "sim-interferometer", "link": "plant"} | (sensor or QUIET_SENSOR),
        seed,
    )


@pytest.fixture(scope="session")
def walking():
    return walking_bench


@pytest.fixture(scope="session")
def spindle():
    return spindle_bench


@pytest.fixture(scope="session")
def motion():
    """Return a short motion, some of it changed."""

    def make(**changes):
        given = {"periods": 2, "samples_per_period": 64, "period_rate_hz": 2.0}
        return Motion(**(given | changes))

    return make
