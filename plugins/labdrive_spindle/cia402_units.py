"""In which units a CiA 402 drive counts: its position and velocity, for a revolution of the motor.

Positions (6064h, 607Ah, ...) go by 60A8h where a drive has it, else by gear ratio (6091h) and feed
constant (6092h), else in increments of the encoder (608Fh); velocities (6081h, ...) by 60A9h, else
in positions a second (IEC 61800-7-201, factor group; codes of units as in CiA 303-2).
"""

from collections.abc import Callable
from fractions import Fraction

from labdrive.model.errors import DeviceError

DIMENSIONLESS, DEGREE, REVOLUTION, INCREMENT = 0x00, 0x41, 0xB4, 0xB5
SECOND, MINUTE = 0x03, 0x47
COARSEST = 16
_SECONDS = {DIMENSIONLESS: 1, SECOND: 1, MINUTE: 60}

Read = Callable[[str], int | None]
"""Returns an object by name; None if the drive has none."""


def counts_per_revolution(read: Read) -> int:
    """Return the units of position in a revolution of the motor.

    DeviceError if the drive counts in a unit that is not known here, or in no whole number of them.
    """
    unit = read("position_unit") or 0
    counts = _in_a_revolution(read, unit >> 16 & 0xFF, "60A8h", unit) / _power(unit)
    if counts.denominator != 1 or counts < COARSEST:
        raise DeviceError(
            f"the drive has {float(counts):g} units of position in a revolution: no whole number, "
            f"or less than {COARSEST}; set its 60A8h, 6091h and 6092h"
        )
    return int(counts)


def velocity_units(read: Read, counts: int) -> float:
    """Return the units of velocity in a revolution a second; `counts`: of position in one."""
    unit = read("velocity_unit") or 0
    code, time = unit >> 16 & 0xFF, unit >> 8 & 0xFF
    if time not in _SECONDS:
        raise DeviceError(f"60A9h is 0x{unit:08X}: a time that is neither a second nor a minute")
    same = code == DIMENSIONLESS
    turn = Fraction(counts) if same else _in_a_revolution(read, code, "60A9h", unit)
    return float(turn * _SECONDS[time] / _power(unit))


def _in_a_revolution(read: Read, code: int, where: str, unit: int) -> Fraction:
    """Return how many of a unit a revolution of the motor is, without its power of ten."""
    gear = _ratio(read, "gear_motor_turns", "gear_shaft_turns") or Fraction(1)
    if code == DEGREE:
        return 360 / gear
    if code == REVOLUTION:
        return 1 / gear
    encoder = _ratio(read, "encoder_counts", "encoder_turns")
    feed = None if code == INCREMENT else _ratio(read, "feed", "feed_shaft_turns")
    if code not in {DIMENSIONLESS, INCREMENT} or not (feed or encoder):
        raise DeviceError(
            f"the drive counts in a unit that is not known here ({where} is 0x{unit:08X}); set it "
            "to increments, revolutions or degrees"
        )
    return feed / gear if feed else encoder or Fraction(0)


def _ratio(read: Read, above: str, below: str) -> Fraction | None:
    numerator, denominator = read(above), read(below)
    return Fraction(numerator, denominator) if numerator and denominator else None


def _power(unit: int) -> Fraction:
    """Return the power of ten in a unit: its highest byte, signed."""
    exponent = (unit >> 24 & 0xFF ^ 0x80) - 0x80
    return Fraction(10) ** exponent
