"""Work out what a recipe will do on its bench before anything moves, and what speaks against it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from labdrive.engine.devices import Devices, build
from labdrive.engine.limits import breaches
from labdrive.interfaces.experiment import Experiment, PlannedRecording
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.errors import InputError, Problem
from labdrive.model.units import format_si
from labdrive.recipe.load import Loaded

BYTES_PER_VALUE = 8
FILE_OVERHEAD_BYTES = 8_000
"""Of a recording: HDF5 structures and attributes, measured on recordings of a few samples."""


@dataclass(frozen=True)
class Plan:
    """What a run will do at most. Travel [`unit`] is relative to where the run starts."""

    recordings: list[PlannedRecording]
    cycles: int
    travel: tuple[float, float]
    unit: str
    duration_s: float
    disk_bytes: int

    @property
    def recording_count(self) -> int:
        """Recordings, at most."""
        return sum(planned.times for planned in self.recordings)


@dataclass(frozen=True)
class Prepared:
    """A recipe ready to run: its experiment, its devices (not connected), its plan."""

    loaded: Loaded
    experiment: Experiment
    devices: Devices
    plan: Plan


def prepare(loaded: Loaded, plugins: PluginSet) -> Prepared:
    """Build experiment and devices and plan the run; InputError with every problem found."""
    problems = list(_name_problems(loaded))
    if problems:
        raise InputError(*problems)
    recipe, bench = loaded.recipe, loaded.bench
    actuator = recipe.actuator or next(iter(bench.actuators))
    with _placed(loaded, "bench"):
        devices = build(bench, plugins, actuator, recipe.seed, Path(loaded.bench_path).parent)
    experiment: Experiment = plugins.experiments[recipe.kind](recipe)
    problems = [loaded.problem("bench", "sensors", text) for text in devices.misfits()]
    if problems:
        raise InputError(*problems)
    with _placed(loaded, "recipe"):
        recordings = experiment.plan(devices)
        for planned in recordings:
            devices.actuator.check(planned.motion)
    plan = _summed(recordings, devices)
    problems = list(_limit_problems(loaded, devices, plan))
    if problems:
        raise InputError(*problems)
    return Prepared(loaded, experiment, devices, plan)


def _name_problems(loaded: Loaded) -> Iterator[Problem]:
    """Yield names in recipe and bench that the bench does not have."""
    recipe, bench = loaded.recipe, loaded.bench
    sensor = getattr(recipe, "sensor", None)
    if sensor is not None and sensor not in bench.sensors:
        has = f"the bench has no such sensor; it has {', '.join(bench.sensors)}"
        yield loaded.problem("recipe", "sensor", has, sensor)
    if recipe.actuator is None and len(bench.actuators) > 1:
        choice = f"say which actuator to drive: {', '.join(bench.actuators)}"
        yield loaded.problem("recipe", "actuator", choice)
    if recipe.actuator is not None and recipe.actuator not in bench.actuators:
        has = f"the bench has no such actuator; it has {', '.join(bench.actuators)}"
        yield loaded.problem("recipe", "actuator", has, recipe.actuator)
    for role in ("actuators", "sensors"):
        for name, device in getattr(bench, role).items():
            link = getattr(device, "link", None)
            if link is not None and link not in bench.links:
                has = f"the bench has no such link; it has {', '.join(bench.links) or 'none'}"
                yield loaded.problem("bench", f"{role}.{name}.link", has, link)


@contextmanager
def _placed(loaded: Loaded, where: Literal["recipe", "bench"]) -> Iterator[None]:
    """Point problems that a plugin raises with a field alone at that field's line."""
    try:
        yield
    except InputError as error:
        places = (
            p if p.file else loaded.problem(where, p.field, p.message, p.got)
            for p in error.problems
        )
        raise InputError(*places) from error


def _summed(recordings: list[PlannedRecording], devices: Devices) -> Plan:
    here = low = high = duration = 0.0
    cycles = disk = 0
    columns = 2 + len(devices.sensors)
    for planned in recordings:
        motion = planned.motion
        walked = motion.periods + motion.settle_periods
        per_period = devices.actuator.travel_per_period(planned.table)
        for _ in range(planned.times):
            there = here + motion.direction.sign * walked * per_period
            low, high = min(low, there), max(high, there)
            here = here if planned.return_to_start else there
        ways = 2 if planned.return_to_start else 1
        cycles += planned.times * ways * walked
        duration += planned.times * ways * motion.duration_s
        values = motion.samples * columns
        disk += planned.times * (values * BYTES_PER_VALUE + FILE_OVERHEAD_BYTES)
    unit = devices.position_unit
    return Plan(recordings, cycles, (low, high), unit, duration, disk)


def _limit_problems(loaded: Loaded, devices: Devices, plan: Plan) -> Iterator[Problem]:
    """Yield what the bench's limits forbid in the plan."""
    if devices.fixed_motion is not None:
        return
    said: set[str] = set()
    for planned in plan.recordings:
        for text in breaches(devices.limits, planned.table, planned.motion):
            if text not in said:
                said.add(text)
                yield loaded.problem("recipe", "motion.period_rate", f"{planned.label}: {text}")
    yield from _travel_problems(loaded, devices, plan)


def _travel_problems(loaded: Loaded, devices: Devices, plan: Plan) -> Iterator[Problem]:
    limits, needed = devices.limits, plan.travel[1] - plan.travel[0]
    if limits.travel is None:
        yield loaded.problem("bench", "limits", "give limits.travel: this actuator moves")
    elif limits.travel_unit != plan.unit:
        unit = f"this actuator travels in {plan.unit}, so limits are due in that unit"
        yield loaded.problem("bench", "limits.travel", unit, limits.travel_unit)
    elif needed > limits.travel.max - limits.travel.min:
        has = format_si(limits.travel.max - limits.travel.min, plan.unit)
        yield loaded.problem(
            "recipe",
            "motion.periods",
            f"the run needs {format_si(needed, plan.unit, 3)} of travel, the bench has {has}; take "
            "fewer periods, or return_to_start: true",
        )
