"""A bench of plain classes: a memoryless screw, a probe on it, and faults on demand."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from pydantic import Field

from labdrive.engine.discovery import PluginHost, discover
from labdrive.engine.plan import prepare
from labdrive.engine.run import Outcome, run
from labdrive.interfaces.devices import Reading, Samples
from labdrive.interfaces.settings import Settings
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive.recipe.load import load

STEP_M = 1e-3
ERROR_M = 5e-6


class Plant:
    """What moves: position = step (theta / 2 pi) + error sin(theta). Keeps what was asked of it."""

    class Settings(Settings):
        pass

    def __init__(self, settings, context):
        self.calls = []
        self.position = np.zeros(1)
        self.offset = 0.0

    def connect(self):
        self.calls.append("link connected")

    def close(self):
        self.calls.append("link closed")


class Screw:
    class Settings(Settings):
        link: str = "plant"
        unit: str = "rad"
        peak: float = TURN
        jump: float = 0.0
        fail: str = ""

    sampling = Sampling.TRIGGERED
    position_unit = "m"
    max_samples_per_period = 1024
    fixed_motion = None

    def __init__(self, settings, context):
        self.settings = settings
        self.plant = context.links[settings.link]

    def nominal_table(self, waveform):
        samples = self.settings.peak * np.arange(1024) / 1024
        samples[100] -= self.settings.jump
        return WaveformTable((Channel("angle", self.settings.unit, samples, self.settings.peak),))

    def travel_per_period(self, table):
        return STEP_M

    def check(self, motion):
        if motion.samples_per_period > 1024:
            raise InputError(Problem("too many", "motion.samples_per_period"))

    def connect(self):
        self.plant.calls.append("drive connected")
        if self.settings.fail == "connect":
            raise DeviceError("the drive does not answer")

    def close(self):
        self.plant.calls.append("drive closed")

    def reference(self):
        self.plant.offset = 0.0

    def load(self, table):
        self.plant.calls.append("table loaded")
        self.table = table

    def play(self, acquisition):
        motion = acquisition.motion
        self.plant.calls.append(f"played {motion.direction} {motion.periods}")
        m, sign = motion.samples_per_period, motion.direction.sign
        start = self.plant.offset
        for first in range(-motion.settle_periods * m, motion.periods * m + 1, m):
            count = min(m, motion.periods * m + 1 - first)
            phase = sign * TURN * np.arange(first, first + count) / m
            theta = self.table.channels[0].at(phase)
            walked = phase[-1] + sign * TURN * motion.settle_periods
            self.plant.position = (
                start
                + STEP_M * (theta / TURN + sign * motion.settle_periods)
                + ERROR_M * np.sin(theta)
            )
            self.plant.offset = start + STEP_M * walked / TURN
            time = (phase / (sign * TURN) + motion.settle_periods) / motion.period_rate_hz
            if self.settings.fail == "play" and first > 0:
                raise ValueError("the driver has a bug")
            yield Samples(phase, time, settling=first < 0)

    def make_safe(self):
        self.plant.calls.append("safe")
        if self.settings.fail == "make_safe":
            raise DeviceError("no answer to the stop")


class Probe:
    class Settings(Settings):
        link: str = "plant"
        unit: str = "m"
        factor: float = 1.0
        nan_after: int = Field(default=0)
        lost: int = 0
        own_clock: bool = False

    def __init__(self, settings, context):
        self.settings = settings
        self.plant = context.links[settings.link]
        self.read_so_far = 0

    @property
    def unit(self):
        return self.settings.unit

    @property
    def samplings(self):
        return frozenset({Sampling.POLLED} if self.settings.own_clock else Sampling)

    def connect(self):
        self.plant.calls.append("probe connected")

    def close(self):
        self.plant.calls.append("probe closed")

    def arm(self, acquisition):
        self.read_so_far = 0

    def read(self, samples):
        self.read_so_far += len(samples.phase)
        value, time = self.settings.factor * self.plant.position, samples.time
        if self.settings.nan_after and self.read_so_far > self.settings.nan_after:
            value = np.full_like(value, np.nan)
        if self.settings.own_clock:
            middle = (time[1:] + time[:-1]) / 2
            return Reading(np.interp(middle, time, value), middle)
        return Reading(value[self.settings.lost :], time[self.settings.lost :])


class Gauge(Probe):
    """A probe that can be read at rest, too: one value after another, the last for ever."""

    class Settings(Probe.Settings):
        rest: tuple[float, ...] = (0.0,)

    def __init__(self, settings, context):
        super().__init__(settings, context)
        self.rest = list(settings.rest)

    def read_at_rest(self):
        return self.rest.pop(0) if len(self.rest) > 1 else self.rest[0]


RECIPE = """\
kind: optimize
title: Screw
bench: bench.yaml
motion: {periods: 4, samples_per_period: 64, period_rate: 2 Hz, return_to_start: false}
sensor: probe
optimizer: {use: fourier}
"""
BENCH = """\
links: {plant: {plugin: plant}}
actuators: {screw: {plugin: screw}}
sensors: {probe: {plugin: probe}}
limits: {travel: {min: -1 m, max: 1 m}, voltage: {min: 0 V, max: 10 V}, slew: 100 V/s}
"""


@dataclass
class Lab:
    """A folder with a recipe and a bench, and the plugins of this file."""

    folder: Path
    host: PluginHost
    events: list = field(default_factory=list)
    plant: Plant | None = None
    recipe: str = RECIPE
    bench: str = BENCH

    def prepare(self, recipe=None, bench=None):
        (self.folder / "recipe.yaml").write_text(recipe or self.recipe)
        (self.folder / "bench.yaml").write_text(bench or self.bench)
        prepared = prepare(load(self.folder / "recipe.yaml", self.host.plugins), self.host.plugins)
        self.plant = prepared.devices.links["plant"]
        return prepared

    def run(self, recipe=None, bench=None) -> Outcome:
        prepared = self.prepare(recipe, bench)
        return run(prepared, self.host, self.folder / "runs", self.events.append)


@pytest.fixture
def lab(tmp_path) -> Lab:
    from dataclasses import replace

    host = discover()
    plugins = replace(
        host.plugins,
        links={"plant": Plant},
        actuators={"screw": Screw},
        sensors={"probe": Probe, "gauge": Gauge},
    )
    return Lab(tmp_path, PluginHost(plugins, host.hooks))
