"""Interlocks at work: readings and the time of day, held against the bench's conditions."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from labdrive.interfaces.devices import Reading, ReadsAtRest
from labdrive.interfaces.interlocks import Interlock
from labdrive.model.errors import DeviceError, InterlockError
from labdrive.model.units import format_si

Clock = Callable[[], datetime]


class PausedError(Exception):
    """A condition that only pauses was broken; `again_after` [s] is how long to wait at least."""

    def __init__(self, reason: str, again_after: float) -> None:
        self.again_after = again_after
        super().__init__(reason)


@dataclass(frozen=True)
class HeldBack:
    """What holds a recording back, and in words how things are now."""

    condition: Interlock
    reason: str


class Interlocks:
    """The conditions of a bench, over one run."""

    def __init__(
        self,
        conditions: Sequence[Interlock],
        units: dict[str, str],
        clock: Clock = lambda: datetime.now(UTC),
        at_rest: Mapping[str, ReadsAtRest] | None = None,
    ) -> None:
        """`at_rest` are the sensors that can be read while nothing moves."""
        self._at_rest = at_rest or {}
        self._conditions = conditions
        self._units = units
        self._clock = clock
        self._first: dict[str, float] = {}

    def first_readings(self) -> dict[str, float]:
        """Return the run's first readings, by sensor, that conditions compare later ones with."""
        relative = {c.sensor for c in self._conditions if c.within is not None and c.of is None}
        return {sensor: first for sensor, first in self._first.items() if sensor in relative}

    def remember(self, first_readings: Mapping[str, float]) -> None:
        """Go on from what a run that was cut short read first."""
        self._first.update(first_readings)

    def watch(self, sensor: str) -> bool:
        """Return whether a condition is held on what a sensor reads while something moves."""
        return any(c.sensor == sensor and c.action != "hold" for c in self._conditions)

    def check_reading(self, sensor: str, reading: Reading) -> None:
        """Raise InterlockError or PausedError if readings, or the time, break a condition."""
        if len(reading.value) == 0:
            return
        first = self._first_reading(sensor, reading)
        for condition in self._conditions:
            if condition.sensor == sensor and condition.action != "hold":
                broken = condition.broken_at(reading.value, first)
                if broken is not None:
                    found = format_si(float(reading.value[broken]), self._units[sensor], 4)
                    late = format_si(float(reading.time[-1] - reading.time[broken]), "s", 2)
                    _break(
                        condition,
                        f"{sensor} read {found}, the bench asks for {condition}; halted {late} "
                        "later in the motion",
                    )
            elif condition.action != "hold" and not condition.holds_at(self._clock()):
                _break(condition, f"the bench is to be used {condition}")

    def held_back_by(self) -> HeldBack | None:
        """Return what holds a recording back now, None if nothing does.

        InterlockError if it never can begin, DeviceError if a sensor does not say.
        """
        for condition in self._conditions:
            if not condition.holds_at(self._clock()):
                if condition.action == "stop":
                    raise InterlockError(f"not started: the bench is to be used {condition}")
                return HeldBack(condition, f"the bench is to be used {condition}")
            if condition.action == "hold" and condition.sensor is not None:
                value = self._read_at_rest(condition.sensor)
                if condition.broken_at(np.array([value]), value) is not None:
                    found = format_si(value, self._units[condition.sensor], 4)
                    reason = f"{condition.sensor} reads {found}, the bench asks for {condition}"
                    return HeldBack(condition, reason)
        return None

    def _read_at_rest(self, sensor: str) -> float:
        value = self._at_rest[sensor].read_at_rest()
        if not math.isfinite(value):
            raise DeviceError(
                f"sensor {sensor} read {value} at rest, which is not a finite number; no recording "
                "begins on it"
            )
        return value

    def bounds(self, sensor: str, reading: Reading) -> Iterator[tuple[float, float]]:
        """Yield the (lowest, highest) that conditions which stop a run allow a sensor.

        `reading` is its latest, and the run's first unless an earlier one is known.
        """
        first = self._first_reading(sensor, reading)
        for condition in self._conditions:
            if condition.sensor == sensor and condition.action == "stop":
                yield condition.range(first)

    def _first_reading(self, sensor: str, reading: Reading) -> float:
        """Return the run's first reading of a sensor: that of before a kill, if there was one."""
        return self._first.setdefault(sensor, float(reading.value[0]))


def _break(condition: Interlock, reason: str) -> None:
    if condition.action == "stop":
        raise InterlockError(reason)
    raise PausedError(reason, condition.again_after if condition.sensor else 0.0)
