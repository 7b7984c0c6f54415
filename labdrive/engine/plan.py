"""Work out what a recipe will do on its bench before anything moves, and what speaks against it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Literal

from labdrive.engine.devices import Devices, build
from labdrive.engine.fields import fields_of
from labdrive.engine.limits import breaches
from labdrive.interfaces.devices import ReadsAtRest
from labdrive.interfaces.experiment import Experiment, PlannedRecording
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.interfaces.settings import BenchName
from labdrive.model.errors import InputError, Problem
from labdrive.model.units import format_si
from labdrive.recipe.load import Loaded

BYTES_PER_VALUE = 8
FILE_OVERHEAD_BYTES = 8_000
"""Of a recording: HDF5 structures and attributes, measured on recordings of a few samples."""


@dataclass(frozen=True)
class Plan:
    """What a run will do at most.

    `travel` [`unit`] is relative to where the run starts, of the actuator that goes furthest.
    """

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

    @property
    def largest_load(self) -> float | None:
        """The largest load that is set [N], None if none is."""
        return max((p.load for p in self.recordings if p.load is not None), default=None)


@dataclass(frozen=True)
class Prepared:
    """A recipe ready to run: its experiment, its devices (not connected), its plan.

    `attended` says that somebody can be asked.
    """

    loaded: Loaded
    experiment: Experiment
    devices: Devices
    plan: Plan
    attended: bool = False

    @property
    def needs_person(self) -> bool:
        """True if somebody has to place the loads of the plan."""
        load = self.devices.bench_load
        return load is not None and load.needs_person and self.plan.largest_load is not None

    def refuse_unattended(self) -> None:
        """Raise InputError if somebody has to be there and nobody is."""
        if self.needs_person and not self.attended:
            message = (
                "a person has to place the loads, and nobody is there to ask; run it at a terminal"
            )
            raise InputError(self.loaded.problem("bench", "load.plugin", message))


def prepare(
    loaded: Loaded, plugins: PluginSet, ask: Callable[[str], str] | None = None
) -> Prepared:
    """Build experiment and devices and plan the run; InputError with every problem found.

    `ask` puts a question to the person at the bench, None if nobody is there.
    """
    problems = list(_name_problems(loaded))
    if problems:
        raise InputError(*problems)
    recipe, bench = loaded.recipe, loaded.bench
    actuator = recipe.actuator or next(iter(bench.actuators))
    folder = Path(loaded.bench_path).parent
    with _placed(loaded, "bench"):
        devices = build(bench, plugins, actuator, recipe.seed, folder, ask)
    experiment: Experiment = plugins.experiments[recipe.kind](recipe)
    problems = [loaded.problem("bench", "sensors", text) for text in devices.misfits()]
    if problems:
        raise InputError(*problems)
    with _placed(loaded, "recipe"):
        recordings = experiment.plan(devices)
        for planned in recordings:
            for name in devices.played(planned.table):
                devices.actuators[name].check(planned.motion)
    plan = _summed(recordings, devices)
    problems = list(_limit_problems(loaded, devices, plan))
    if problems:
        raise InputError(*problems)
    return Prepared(loaded, experiment, devices, plan, attended=ask is not None)


def _name_problems(loaded: Loaded) -> Iterator[Problem]:
    """Yield names in recipe and bench that the bench does not have."""
    recipe, bench = loaded.recipe, loaded.bench
    named = list(_device_names(recipe))
    for path, role, name in named:
        known = getattr(bench, role)
        if name not in known:
            has = f"the bench has no such {role[:-1]}; it has {', '.join(known)}"
            yield loaded.problem("recipe", path, has, name)
    if len(bench.actuators) > 1 and not any(role == "actuators" for _, role, _ in named):
        choice = f"say which actuator to drive: {', '.join(bench.actuators)}"
        yield loaded.problem("recipe", "actuator", choice)
    for path, device in _devices_with_links(bench):
        if device.link not in bench.links:
            has = f"the bench has no such link; it has {', '.join(bench.links) or 'none'}"
            yield loaded.problem("bench", f"{path}.link", has, device.link)


def _device_names(recipe: Any) -> Iterator[tuple[str, str, str]]:
    """Yield (field, role, name) wherever a recipe names a device of its bench."""
    for field in fields_of(recipe):
        for mark in field.info.metadata:
            if isinstance(mark, BenchName) and field.value is not None:
                yield field.path, mark.role, field.value


def _devices_with_links(bench: Any) -> Iterator[tuple[str, Any]]:
    devices = [
        (f"{role}.{name}", device)
        for role in ("actuators", "sensors")
        for name, device in getattr(bench, role).items()
    ]
    for path, device in [*devices, ("load", bench.load)]:
        if getattr(device, "link", None) is not None:
            yield path, device


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
    duration = 0.0
    cycles = disk = 0
    columns = 2 + len(devices.sensors)
    for planned in recordings:
        motion = planned.motion
        ways = 2 if planned.return_to_start else 1
        cycles += planned.times * ways * (motion.periods + motion.settle_periods)
        duration += planned.times * ways * motion.duration_s
        values = motion.samples * columns
        disk += planned.times * (values * BYTES_PER_VALUE + FILE_OVERHEAD_BYTES)
    spans = [_travel(recordings, devices, name) for name in devices.actuators]
    widest = max(spans, key=lambda span: span[1] - span[0])
    return Plan(recordings, cycles, widest, devices.position_unit, duration, disk)


def _travel(
    recordings: list[PlannedRecording], devices: Devices, actuator: str
) -> tuple[float, float]:
    """Return how far an actuator goes to either side of its start."""
    here = low = high = 0.0
    for planned in recordings:
        tables = devices.played(planned.table)
        if actuator not in tables:
            continue
        walked = planned.motion.direction.sign * (
            planned.motion.periods + planned.motion.settle_periods
        )
        there = walked * devices.actuators[actuator].travel_per_period(tables[actuator])
        times = 1 if planned.return_to_start else planned.times
        low, high = min(low, here + times * there), max(high, here + times * there)
        here = here if planned.return_to_start else here + times * there
    return low, high


def _limit_problems(loaded: Loaded, devices: Devices, plan: Plan) -> Iterator[Problem]:
    """Yield what the bench's limits forbid in the plan."""
    if devices.fixed_motion is not None:
        return
    said: set[str] = set()
    for planned in plan.recordings:
        tables = devices.played(planned.table).values()
        found = (breaches(devices.limits, table, planned.motion) for table in tables)
        for text in chain.from_iterable(found):
            if text not in said:
                said.add(text)
                yield loaded.problem("recipe", "motion.period_rate", f"{planned.label}: {text}")
    yield from _travel_problems(loaded, devices, plan)
    yield from _load_problems(loaded, devices, plan)
    yield from _interlock_problems(loaded, devices)


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


def _load_problems(loaded: Loaded, devices: Devices, plan: Plan) -> Iterator[Problem]:
    most, largest = devices.limits.force, plan.largest_load
    if largest is None:
        return
    if not devices.has_load:
        text = "the recipe sets loads, so the bench must name what puts them on: `load`"
        yield loaded.problem("bench", "load", text)
    elif most is not None and largest >= most:
        text = f"a load of {largest:g} N would pass the bench's force limit of {most:g} N"
        yield loaded.problem("bench", "limits.force", text)


def _interlock_problems(loaded: Loaded, devices: Devices) -> Iterator[Problem]:
    """Yield conditions on sensors that the bench does not have, or in other units than theirs."""
    for i, interlock in enumerate(devices.interlocks):
        place, name = f"interlocks.{i}", interlock.sensor
        if name is None:
            continue
        if name not in devices.sensors:
            has = f"the bench has no such sensor; it has {', '.join(devices.sensors)}"
            yield loaded.problem("bench", f"{place}.sensor", has, name)
            continue
        if interlock.action == "hold" and not isinstance(devices.sensors[name], ReadsAtRest):
            text = f"{name} cannot be read while nothing moves, so it can pause or stop, not hold"
            yield loaded.problem("bench", f"{place}.action", text, "hold")
        unit = devices.sensors[name].unit
        for quantity in interlock.quantities:
            if quantity.unit != unit:
                text = f"{name} reads {unit}, so a value in that unit is due"
                yield loaded.problem("bench", place, text, quantity.unit)
