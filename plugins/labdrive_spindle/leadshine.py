"""Leadshine CS2RS closed-loop steppers: path 0 of the PR mode, written and triggered in one frame.

Source: CS2RS series user manual, 4.5 (immediate trigger) and 4.3 (status, control word).
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from labdrive.model.errors import DeviceError
from labdrive_spindle.register_maps import LEADSHINE_PATH
from labdrive_spindle.registers import Unit
from labdrive_spindle.spindle import Homing, Profile

ABSOLUTE = 0x0001
RUN_PATH_0 = 0x0010
HOME = 0x0020
HERE_IS_HOME = 0x0021
QUICK_STOP = 0x0040
RESET_ALARM = 0x1111

FAULT, RUNNING, PATH_DONE, HOMED = 1 << 0, 1 << 2, 1 << 5, 1 << 6
TAKE_CURRENT_POSITION = frozenset({35, 37})
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

    @property
    def position(self) -> int:
        """Where the motor stands, by its encoder."""
        return self.unit.read("position")

    def prepare(self, profile: Profile) -> int:
        """Enable the motor; return the alarm of an earlier time, which is reset, or 0."""
        self.rpm = max(1, round(60 * profile.velocity))
        self.ramp_ms = max(1, round(1e6 * profile.acceleration_time / self.rpm))
        alarm = 0
        if self.unit.read("status") & FAULT:
            alarm = self.unit.read("alarm")
            self.unit.write("auxiliary", RESET_ALARM)
        self.unit.write("enable", 1)
        self.check()
        return alarm

    def home(self, homing: Homing) -> None:
        """Take where it stands as home (35, 37), or home as the drive is set up to."""
        here = homing.method in TAKE_CURRENT_POSITION
        self.unit.write("control", HERE_IS_HOME if here else HOME)
        until = time.monotonic() + homing.timeout
        while not here and not self._status() & HOMED:
            if time.monotonic() > until:
                self.stop()
                raise DeviceError(f"{self.name}: no home found within {homing.timeout:g} s")
            time.sleep(0.02)

    def start(self, counts: int) -> None:
        """Begin to move to a position."""
        self._write_path(path_block(counts, self.rpm, self.ramp_ms))

    def arrived(self) -> bool:
        """Whether it is there; DeviceError for an alarm."""
        status = self._status()
        return bool(status & PATH_DONE) and not status & RUNNING

    def stop(self) -> None:
        """Stop at once, and hold."""
        self.unit.write("control", QUICK_STOP)

    def check(self) -> None:
        """Raise DeviceError, in words, if the drive has an alarm."""
        self._status()

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
