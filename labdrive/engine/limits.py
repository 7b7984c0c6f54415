"""Limits of a bench: what a table and motion ask for, and what sensors see while moving."""

from collections.abc import Iterator, Mapping

import numpy as np

from labdrive.engine.interlocks import Interlocks
from labdrive.engine.supervisor import Supervisor
from labdrive.interfaces.devices import Reading
from labdrive.interfaces.limits import Limits, TravelRange
from labdrive.model.errors import DeviceError, InterlockError, LimitError
from labdrive.model.motion import Motion
from labdrive.model.units import format_si
from labdrive.model.waveform import Channel, WaveformTable


def breaches(limits: Limits, table: WaveformTable, motion: Motion) -> Iterator[str]:
    """Yield, in words, each limit that playing `table` over `motion` would break."""
    top = limits.period_rate
    if top is not None and motion.period_rate_hz > top:
        rate = format_si(motion.period_rate_hz, "Hz")
        yield f"period rate {rate} is above the bench's limit of {format_si(top, 'Hz')}"
    for channel in table.channels:
        if channel.unit == "V":
            yield from _voltage_breaches(limits, channel, motion.period_rate_hz)


def _voltage_breaches(limits: Limits, channel: Channel, period_rate_hz: float) -> Iterator[str]:
    if limits.voltage is None:
        yield f"channel {channel.name} is in volts, but the bench gives no limits.voltage"
        return
    allowed = limits.voltage
    slack = 1e-9 * (allowed.max - allowed.min)
    low, high = float(np.min(channel.samples)), float(np.max(channel.samples))
    if low < allowed.min - slack or high > allowed.max + slack:
        yield (
            f"channel {channel.name} spans {low:.4g} to {high:.4g} V, outside the bench's "
            f"{allowed.min:g} to {allowed.max:g} V"
        )
    slew, most = channel.steepest() * period_rate_hz, limits.slew_v_per_s
    if most is not None and slew > most:
        yield (
            f"channel {channel.name} changes by {slew:.4g} V/s, above the bench's slew limit of "
            f"{most:.4g} V/s; lower the period rate"
        )


def refuse_breaches(limits: Limits, table: WaveformTable, motion: Motion) -> None:
    """Raise LimitError, naming every limit that would be broken, before anything moves."""
    found = list(breaches(limits, table, motion))
    if found:
        raise LimitError("refused before moving: " + "; ".join(found))


class Watch:
    """Holds each chunk of readings against the limits while things move.

    `units` are the sensors' by name. `position` is what each position sensor read last, and
    `values_a_cycle` how many values it told apart in a cycle.
    """

    def __init__(
        self,
        limits: Limits,
        units: Mapping[str, str],
        position_unit: str,
        interlocks: Interlocks | None = None,
        supervisor: Supervisor | None = None,
    ) -> None:
        self._limits = limits
        self._interlocks = interlocks or Interlocks((), {})
        self._supervisor = supervisor or Supervisor()
        self._bounded: set[str] = set()
        self._units = units
        self._position_unit = position_unit
        self.position: dict[str, float] = {}
        self.values_a_cycle: dict[str, float] = {}

    @property
    def silence_s(self) -> float:
        """How long something may move without a reading."""
        return self._limits.silence

    def guards(self, sensor: str) -> bool:
        """Return whether a limit or condition is held on what a sensor reads."""
        unit, limits = self._units[sensor], self._limits
        if unit == self._position_unit and limits.travel is not None:
            return True
        if unit == "N" and limits.force is not None:
            return True
        return self._interlocks.watch(sensor)

    def check(self, sensor: str, reading: Reading) -> None:
        """Raise InterlockError if a limit was passed, DeviceError if a reading is no number.

        PausedError if a condition was broken that only pauses.
        """
        if len(reading.value) == 0:
            return
        if not np.all(np.isfinite(reading.value)):
            raise DeviceError(f"sensor {sensor} returned a reading that is not a finite number")
        self._tell(sensor, reading)
        unit = self._units[sensor]
        if unit == self._position_unit:
            self.position[sensor] = float(reading.value[-1])
            self._check_travel(sensor, reading, unit)
        elif unit == "N":
            self._check_force(sensor, reading)
        self._interlocks.check_reading(sensor, reading)

    def _tell(self, sensor: str, reading: Reading) -> None:
        """Let the supervisor hold the same limits, from outside."""
        if sensor not in self._bounded:
            self._bounded.add(sensor)
            for low, high in self._bounds(sensor, reading):
                self._supervisor.tell_bounds(sensor, low, high)
        self._supervisor.tell_reading(
            sensor, float(np.min(reading.value)), float(np.max(reading.value))
        )

    def _bounds(self, sensor: str, reading: Reading) -> Iterator[tuple[float, float]]:
        unit, limits = self._units[sensor], self._limits
        if unit == self._position_unit and limits.travel is not None:
            yield limits.travel.min, limits.travel.max
        if unit == "N" and limits.force is not None:
            yield -limits.force, limits.force
        yield from self._interlocks.bounds(sensor, reading)

    def refuse_travel(self, travel: float) -> None:
        """Raise LimitError if a motion from here by `travel` would pass an end of the range."""
        allowed, unit = self._limits.travel, self._position_unit
        if allowed is None:
            return
        for sensor, here in self.position.items():
            if not allowed.min <= here + travel <= allowed.max:
                raise LimitError(
                    f"refused before moving: {sensor} is at {format_si(here, unit, 6)}, and a "
                    f"motion of about {format_si(travel, unit, 3)} would leave the bench's travel "
                    f"of {_span(allowed, unit)}"
                )

    def _check_travel(self, sensor: str, reading: Reading, unit: str) -> None:
        allowed = self._limits.travel
        if allowed is None:
            return
        for value in (float(np.min(reading.value)), float(np.max(reading.value))):
            if not allowed.min <= value <= allowed.max:
                raise InterlockError(
                    f"{sensor} passed the bench's travel limit: "
                    f"{format_si(value, unit, 6)} is outside {_span(allowed, unit)}"
                )

    def _check_force(self, sensor: str, reading: Reading) -> None:
        most, value = self._limits.force, float(np.max(np.abs(reading.value)))
        if most is not None and value > most:
            raise InterlockError(
                f"{sensor} passed the bench's force limit: {value:.4g} N is above {most:.4g} N"
            )


def _span(allowed: TravelRange, unit: str) -> str:
    return f"{format_si(allowed.min, unit)} to {format_si(allowed.max, unit)}"
