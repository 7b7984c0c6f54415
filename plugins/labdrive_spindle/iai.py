"""IAI ROBO Cylinder controllers: the numerical value movement command, in steps of 0.01 mm.

Source: IAI, Modbus instruction manual, 4.3.2 (status), 5.4.6 (pause), 5.4.7 (home return), 5.5.1
(control), 5.6.1 (movement).
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from labdrive.model.errors import DeviceError
from labdrive_spindle.late_status import Move, wait_until
from labdrive_spindle.register_maps import IAI_MOVE, IAI_STATUS
from labdrive_spindle.registers import Unit
from labdrive_spindle.spindle import Homing, Profile

HUNDREDTH_OF_MM = 1e-5
STANDARD_GRAVITY = 9.80665

# Bits of DRG1.
SERVO_ON, ALARM_RESET, PAUSE, HOME = 1 << 12, 1 << 8, 1 << 5, 1 << 4
# Bits of DSS1.
EMERGENCY, SERVO_IS_ON, MAJOR, MINOR = 1 << 15, 1 << 12, 1 << 10, 1 << 9
HOMED, THERE = 1 << 4, 1 << 3
# Bits of DSSE.
HOMING, MOVING = 1 << 11, 1 << 5
POSITIONING_BAND = 1
OBEYS_S = 2.0


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
    energized: bool = False
    _move: Move = field(default_factory=Move)

    @property
    def counts_per_revolution(self) -> float:
        """Hundredths of a millimetre in a revolution of the screw, exactly: it need be no whole."""
        return self.lead / HUNDREDTH_OF_MM

    @property
    def position(self) -> int:
        """Where the axis stands [0.01 mm]."""
        return self.unit.read("position")

    def prepare(self, profile: Profile) -> int:
        """Return the alarm of an earlier time, which is reset, or 0; energize nothing."""
        speed = profile.velocity * self.lead
        self.speed = max(1, round(speed / HUNDREDTH_OF_MM))
        gravities = speed / profile.acceleration_time / STANDARD_GRAVITY
        self.acceleration = max(1, round(100 * gravities))
        alarm, status = 0, self.unit.read("status")
        if status & (MAJOR | MINOR):
            alarm = self.unit.read("alarm")
            as_it_was = PAUSE | (SERVO_ON if status & SERVO_IS_ON else 0)
            self.unit.write("control", as_it_was | ALARM_RESET)
            wait_until(lambda: not self.unit.read("status") & (MAJOR | MINOR), OBEYS_S)
            self.unit.write("control", as_it_was)
        self.check()
        return alarm

    def home(self, homing: Homing) -> None:
        """Return home, as the controller is set up to."""
        self._energize()
        self.unit.write("control", SERVO_ON)  # HOME is taken when it rises
        self.unit.write("control", SERVO_ON | HOME)
        # HOMED may still be that of an earlier homing, of an earlier run even.
        self._await(lambda: not self._homed(), "it does not begin to home")
        self._await(self._homed, "no home found", homing.timeout)
        self.unit.write("control", SERVO_ON)

    def start(self, counts: int) -> None:
        """Begin to move to a position; energize the motor, if labdrive has not yet."""
        self._energize()
        block = move_block(counts, self.speed, self.acceleration)
        self.unit.bus.write(self.unit.number, IAI_MOVE, block, single=False)
        self._move = Move()

    def arrived(self) -> bool:
        """Whether it is there; DeviceError for an alarm, or if the servo is off."""
        status, expansion = self._moving_status()
        return self._move.ended(there=bool(status & THERE) and not expansion & MOVING)

    def stop(self) -> None:
        """Stop at once, and hold; a servo that is off is left off.

        One that does not say is stopped all the same.
        """
        self.energized = False
        with suppress(DeviceError):
            if not self.unit.read("status") & SERVO_IS_ON:
                return
        self.unit.write("control", SERVO_ON | PAUSE)

    def check(self) -> None:
        """Raise DeviceError, in words, if the controller has an alarm."""
        self._status()

    def _homed(self) -> bool:
        status, expansion = self._moving_status()
        return bool(status & HOMED) and not expansion & (HOMING | MOVING)

    def _energize(self) -> None:
        """Switch the servo on, once: what took it off in mid-motion must be told instead."""
        if not self.energized:
            self.unit.write("control", SERVO_ON | PAUSE)
            self._await(lambda: bool(self._status()[0] & SERVO_IS_ON), "the servo is not on")
            # What a pause left of a move would be resumed after it: reset, it is not (5.4.6).
            self.unit.write("control", SERVO_ON | PAUSE | ALARM_RESET)
            self.unit.write("control", SERVO_ON)
            self.energized = True

    def _await(self, true: Callable[[], bool], otherwise: str, seconds: float = OBEYS_S) -> None:
        if not wait_until(true, seconds):
            self.stop()
            raise DeviceError(f"{self.name}: {otherwise} within {seconds:g} s")

    def _moving_status(self) -> tuple[int, int]:
        status, expansion = self._status()
        if not status & SERVO_IS_ON:
            raise DeviceError(
                f"{self.name}: the servo went off in mid-motion, without an alarm; did somebody "
                "switch it off, or open its enable?"
            )
        return status, expansion

    def _status(self) -> tuple[int, int]:
        """Return DSS1 and DSSE; DeviceError for an alarm."""
        status, _, expansion = self.unit.bus.read(self.unit.number, 3, IAI_STATUS, 3)
        if status & EMERGENCY:
            raise DeviceError(f"{self.name}: the emergency stop is pressed; release it")
        if status & (MAJOR | MINOR):
            alarm = self.unit.read("alarm")
            raise DeviceError(f"{self.name}: the drive stopped itself: alarm 0x{alarm:03X}")
        return status, expansion
