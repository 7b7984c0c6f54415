"""Leadshine CS2RS closed-loop steppers: path 0 of the PR mode, written and triggered in one frame.

Source: CS2RS series user manual, 4.5 (immediate trigger) and 4.3 (status, control word).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from labdrive.model.errors import DeviceError
from labdrive_spindle.late_status import Move, wait_until
from labdrive_spindle.register_maps import LEADSHINE_PATH
from labdrive_spindle.registers import Unit
from labdrive_spindle.spindle import Homing, Profile

ABSOLUTE = 0x0001
RUN_PATH_0 = 0x0010
HOME = 0x0020
HERE_IS_HOME = 0x0021
QUICK_STOP = 0x0040
RESET_ALARM = 0x1111

FAULT, ENABLED, RUNNING, PATH_DONE, HOMED = 1 << 0, 1 << 1, 1 << 2, 1 << 5, 1 << 6
TAKE_CURRENT_POSITION = frozenset({35, 37})
OBEYS_S = 2.0
ALARMS = {
    0x01: "over-current",
    0x02: "over-voltage",
    0x40: "a current sampling error",
    0x80: "a failure to lock the shaft",
    0x200: "an EEPROM error",
    0x100: "a failure of auto-tuning",
    0x20: "too large a following error",
}


def path_block(counts: int, rpm: int, ramp_ms: int, mode: int = ABSOLUTE) -> list[int]:
    """Return the eight registers that describe path 0 and start it.

    `ramp_ms` is the time to reach 1000 rpm, up as down.
    """
    high, low = (counts >> 16) & 0xFFFF, counts & 0xFFFF
    return [mode, high, low, rpm, ramp_ms, ramp_ms, 0, RUN_PATH_0]


@dataclass
class LeadshineDrive:
    """Moves by path 0. Positions are in counts (pulses)."""

    unit: Unit
    name: str
    counts_per_revolution: int
    rpm: int = 60
    ramp_ms: int = 100
    energized: bool = False
    _move: Move = field(default_factory=Move)

    @property
    def position(self) -> int:
        """Where the motor stands, by its encoder."""
        return self.unit.read("position")

    def prepare(self, profile: Profile) -> int:
        """Return the alarm of an earlier time, which is reset, or 0; energize nothing."""
        self.rpm = max(1, round(60 * profile.velocity))
        self.ramp_ms = max(1, round(1e6 * profile.acceleration_time / self.rpm))
        alarm = 0
        if self.unit.read("status") & FAULT:
            alarm = self.unit.read("alarm")
            self.unit.write("auxiliary", RESET_ALARM)
            wait_until(lambda: not self.unit.read("status") & FAULT, OBEYS_S)
        self.check()
        return alarm

    def home(self, homing: Homing) -> None:
        """Take where it stands as home (35, 37), or home as the drive is set up to."""
        self._energize()
        if homing.method in TAKE_CURRENT_POSITION:
            self.unit.write("control", HERE_IS_HOME)
            near = self.counts_per_revolution / 50
            self._await(lambda: abs(self.position) < near, "it does not take its position as home")
            return
        self.unit.write("control", HOME)
        # HOMED may still be that of an earlier homing, of an earlier run even.
        self._await(lambda: not self._homed(), "it does not begin to home")
        self._await(self._homed, "no home found", homing.timeout)

    def start(self, counts: int) -> None:
        """Begin to move to a position; energize the motor, if labdrive has not yet."""
        self._energize()
        self._write_path(path_block(counts, self.rpm, self.ramp_ms))
        self._move = Move()

    def arrived(self) -> bool:
        """Whether it is there; DeviceError for an alarm, or if the motor is not energized."""
        there = self._moving_status() & (RUNNING | PATH_DONE) == PATH_DONE
        return self._move.ended(there=there)

    def stop(self) -> None:
        """Stop at once, and hold; a motor without power is left without."""
        self.energized = False
        self.unit.write("control", QUICK_STOP)

    def check(self) -> None:
        """Raise DeviceError, in words, if the drive has an alarm."""
        self._status()

    def _homed(self) -> bool:
        return self._moving_status() & (RUNNING | HOMED) == HOMED

    def _energize(self) -> None:
        """Enable the motor, once: what took its enable in mid-motion must be told instead."""
        if not self.energized:
            self.unit.write("enable", 1)
            self._await(lambda: bool(self._status() & ENABLED), "the motor is not energized")
            self.energized = True

    def _await(self, true: Callable[[], bool], otherwise: str, seconds: float = OBEYS_S) -> None:
        if not wait_until(true, seconds):
            self.stop()
            raise DeviceError(f"{self.name}: {otherwise} within {seconds:g} s")

    def _moving_status(self) -> int:
        status = self._status()
        if not status & ENABLED:
            raise DeviceError(
                f"{self.name}: the motor lost its power in mid-motion, without an alarm; is its "
                "enable input open?"
            )
        return status

    def _status(self) -> int:
        status = self.unit.read("status")
        if status & FAULT:
            alarm = self.unit.read("alarm")
            word = ALARMS.get(alarm, "an alarm")
            raise DeviceError(
                f"{self.name}: the drive stopped itself: {word} (alarm 0x{alarm:04X})"
            )
        return status

    def _write_path(self, block: Sequence[int]) -> None:
        self.unit.bus.write(self.unit.number, LEADSHINE_PATH, block, single=False)
