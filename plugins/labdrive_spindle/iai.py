"""IAI ROBO Cylinder controllers: the numerical value movement command, in steps of 0.01 mm.

Source: IAI, Modbus instruction manual, 4.3.2 (status), 5.5.1 (control), 5.6.1 (movement).
"""

import time
from dataclasses import dataclass

from labdrive.model.errors import DeviceError
from labdrive_spindle.register_maps import IAI_MOVE
from labdrive_spindle.registers import Unit
from labdrive_spindle.spindle import Homing, Profile

HUNDREDTH_OF_MM = 1e-5
STANDARD_GRAVITY = 9.80665

# Bits of DRG1.
SERVO_ON, ALARM_RESET, PAUSE, HOME = 1 << 12, 1 << 8, 1 << 5, 1 << 4
# Bits of DSS1.
EMERGENCY, SERVO_IS_ON, MAJOR, MINOR = 1 << 15, 1 << 12, 1 << 10, 1 << 9
HOMED, THERE = 1 << 4, 1 << 3
POSITIONING_BAND = 1
SERVO_ON_S = 2.0


def move_block(hundredths: int, speed: int, acceleration: int) -> list[int]:
    """Return the nine registers of a move, in 0.01 mm, 0.01 mm/s and 0.01 G."""
    return [
        *(hundredths >> 16 & 0xFFFF, hundredths & 0xFFFF),
        *(0, POSITIONING_BAND),
        *(speed >> 16, speed & 0xFFFF),
        acceleration,
        0,
        0,
    ]


@dataclass
class IaiDrive:
    """Moves to lengths; a count is 0.01 mm."""

    unit: Unit
    name: str
    lead: float
    speed: int = 100
    acceleration: int = 1

    @property
    def counts_per_revolution(self) -> int:
        """Hundredths of a millimetre in a revolution of the screw."""
        return round(self.lead / HUNDREDTH_OF_MM)

    @property
    def position(self) -> int:
        """Where the axis stands [0.01 mm]."""
        return self.unit.read("position")

    def prepare(self, profile: Profile) -> int:
        """Switch the servo on; return the alarm of an earlier time, which is reset, or 0."""
        speed = profile.velocity * self.lead
        self.speed = max(1, round(speed / HUNDREDTH_OF_MM))
        gravities = speed / profile.acceleration_time / STANDARD_GRAVITY
        self.acceleration = max(1, round(100 * gravities))
        alarm = 0
        if self.unit.read("status") & (MAJOR | MINOR):
            alarm = self.unit.read("alarm")
            self.unit.write("control", ALARM_RESET)
        self.unit.write("control", SERVO_ON)
        self._wait_for(SERVO_IS_ON, SERVO_ON_S, "the servo does not switch on")
        return alarm

    def home(self, homing: Homing) -> None:
        """Return home, as the controller is set up to."""
        self.unit.write("control", SERVO_ON | HOME)
        self._wait_for(HOMED, homing.timeout, "no home found")
        self.unit.write("control", SERVO_ON)

    def start(self, counts: int) -> None:
        """Begin to move to a position."""
        self.unit.write("control", SERVO_ON)
        block = move_block(counts, self.speed, self.acceleration)
        self.unit.bus.write(self.unit.number, IAI_MOVE, block, single=False)

    def arrived(self) -> bool:
        """Whether it is there; DeviceError for an alarm."""
        return bool(self._status() & THERE)

    def stop(self) -> None:
        """Stop at once, and hold."""
        self.unit.write("control", SERVO_ON | PAUSE)

    def check(self) -> None:
        """Raise DeviceError, in words, if the controller has an alarm."""
        self._status()

    def _status(self) -> int:
        status = self.unit.read("status")
        if status & EMERGENCY:
            raise DeviceError(f"{self.name}: the emergency stop is pressed; release it")
        if status & (MAJOR | MINOR):
            alarm = self.unit.read("alarm")
            raise DeviceError(f"{self.name}: the drive stopped itself: alarm 0x{alarm:03X}")
        return status

    def _wait_for(self, bit: int, seconds: float, otherwise: str) -> None:
        until = time.monotonic() + seconds
        while not self._status() & bit:
            if time.monotonic() > until:
                raise DeviceError(f"{self.name}: {otherwise} within {seconds:g} s")
            time.sleep(0.02)
