"""A CiA 402 drive that moves by itself: homing and profile position, the same on every bus."""

import math
import time
from dataclasses import dataclass, field

from labdrive.model.errors import DeviceError
from labdrive_spindle.cia402 import (
    AT_ONCE,
    ENABLE_OPERATION,
    FOLLOWING_ERROR,
    HOMED,
    HOMING_ERROR,
    POLL_S,
    SET_POINT_TAKEN,
    START,
    TARGET_REACHED,
    Mode,
    Objects,
    StateMachine,
)
from labdrive_spindle.spindle import Homing, Profile

TAKE_MODE_S = 1.0
TAKE_SET_POINT_S = 1.0


@dataclass
class Cia402Drive:
    """Commands one drive through its objects. Positions are in counts.

    `velocity_units`: the drive's units in a revolution a second; those of position by default.
    `unstopped`: a stop was asked for, and the drive has not said that it came.
    """

    objects: Objects
    name: str
    counts_per_revolution: int
    velocity_units: float = 0.0
    machine: StateMachine = field(init=False)
    unstopped: bool = field(init=False, default=False)
    _enabled: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self.machine = StateMachine(self.objects, self.name)
        self.velocity_units = self.velocity_units or self.counts_per_revolution

    @property
    def position(self) -> int:
        """Where the motor stands."""
        return self.objects.read("position")

    def prepare(self, profile: Profile) -> int:
        """Tell the drive how fast it may move by itself.

        Return the fault of an earlier time, which is acknowledged, or 0.
        """
        code = self.machine.reset_fault()
        velocity = profile.velocity * self.velocity_units
        acceleration = math.ceil(velocity / profile.acceleration_time)
        self.objects.write("profile_velocity", max(1, round(velocity)))
        for name in ("profile_acceleration", "profile_deceleration"):
            if self.objects.has(name):
                self.objects.write(name, acceleration)
        return code

    def use(self, mode: Mode) -> None:
        """Take a mode of operation; DeviceError if the drive does not say that it has it.

        A drive that does not know a mode says nothing: its display tells.
        """
        self.objects.write("mode", mode)
        until = time.monotonic() + TAKE_MODE_S
        while (shown := self.objects.read("mode_display")) != mode:
            if time.monotonic() > until:
                word = mode.name.lower().replace("_", " ")
                raise DeviceError(
                    f"{self.name}: the drive refuses the mode {word} ({mode.value}): it shows "
                    f"{shown}; does it support it (object 6502h)?"
                )
            time.sleep(POLL_S)

    def home(self, homing: Homing) -> None:
        """Find the home; DeviceError if the drive does not."""
        if not self.objects.has("homing_method"):
            raise DeviceError(
                f"{self.name}: the homing method (6098h) is not among its registers; add it, or "
                "leave homing out and home the drive by hand"
            )
        self.use(Mode.HOMING)
        self.objects.write("homing_method", homing.method)
        for name, speed in (("homing_velocity", homing.velocity), ("homing_slow", homing.slow)):
            if self.objects.has(name):
                self.objects.write(name, max(1, round(speed * self.velocity_units)))
        self.enable()
        self.machine.command(ENABLE_OPERATION)
        self.machine.command(ENABLE_OPERATION | START)
        until = time.monotonic() + homing.timeout
        while not self._homed():
            if time.monotonic() > until:
                self.machine.quick_stop()
                raise DeviceError(f"{self.name}: no home found within {homing.timeout:g} s")
            time.sleep(POLL_S)
        self.machine.command(ENABLE_OPERATION)

    def _homed(self) -> bool:
        status = self._checked_status()
        if status & HOMING_ERROR:
            raise DeviceError(
                f"{self.name}: homing failed; is the method one of the drive's, and is its switch "
                "or index within reach?"
            )
        return bool(status & HOMED and status & TARGET_REACHED)

    def enable(self) -> None:
        """Reach operation, if not there since the last stop.

        DeviceError if the drive has left it by itself: what took it out may not want it back.
        """
        if self._enabled:
            self._checked_status()
            return
        self.machine.enable()
        self._enabled = True

    def start(self, counts: int) -> None:
        """Begin to move to a position; `arrived` says when it is there."""
        self.use(Mode.PROFILE_POSITION)
        self.enable()
        self.machine.command(ENABLE_OPERATION)
        self.objects.write("target_position", counts)
        self.machine.command(ENABLE_OPERATION | START | AT_ONCE)
        until = time.monotonic() + TAKE_SET_POINT_S
        while not self._checked_status() & SET_POINT_TAKEN:
            if time.monotonic() > until:
                raise DeviceError(f"{self.name}: the drive does not take a new set-point")
            time.sleep(POLL_S)
        self.machine.command(ENABLE_OPERATION)

    def arrived(self) -> bool:
        """Whether the target is reached; DeviceError for a fault or a following error."""
        status = self._checked_status()
        if status & FOLLOWING_ERROR:
            raise DeviceError(f"{self.name}: the drive does not follow: too large an error")
        return bool(status & TARGET_REACHED)

    def stop(self) -> None:
        """Stop at once, and hold."""
        self._enabled, self.unstopped = False, True
        self.machine.quick_stop()
        self.unstopped = False

    def check(self) -> None:
        """Raise DeviceError, in words, if the drive has a fault, or has restarted."""
        self.machine.check(self.objects.read("statusword"))
        self.objects.refuse_trouble()

    def _checked_status(self) -> int:
        """Return the statusword; DeviceError, in words, if the drive does not do as it is told."""
        status = self.objects.read("statusword")
        self.machine.refuse_idle(status)
        self.objects.refuse_trouble()
        return status
