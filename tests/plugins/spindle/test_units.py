"""The units a CiA 402 drive counts in, as it says by its objects."""

import pytest

from labdrive.model.errors import DeviceError
from labdrive_spindle.cia402_units import counts_per_revolution, velocity_units

ENCODER = {"encoder_counts": 1 << 20, "encoder_turns": 1}
RPM, RPS, DEGREES_PER_S = 0x00B44700, 0x00B40300, 0x00410300


@pytest.mark.parametrize(
    ("objects", "counts"),
    [
        (ENCODER, 1 << 20),
        (ENCODER | {"encoder_turns": 2}, 1 << 19),
        (ENCODER | {"feed": 4096, "feed_shaft_turns": 1}, 4096),
        (ENCODER | {"feed": 10_000, "feed_shaft_turns": 2}, 5000),
        (
            ENCODER
            | {"feed": 40_000, "feed_shaft_turns": 1, "gear_motor_turns": 4, "gear_shaft_turns": 1},
            10_000,
        ),
        # Tenths of a degree, as Nanotec's drives are delivered.
        (ENCODER | {"position_unit": 0xFF410000, "feed": 1, "feed_shaft_turns": 1}, 3600),
        (ENCODER | {"position_unit": 0xFDB40000}, 1000),
        (ENCODER | {"position_unit": 0x00B50000, "feed": 1, "feed_shaft_turns": 1}, 1 << 20),
    ],
)
def test_positions_a_revolution(objects, counts):
    assert counts_per_revolution(objects.get) == counts


@pytest.mark.parametrize(
    ("unit", "velocity"),
    [
        (None, 4096.0),
        (0, 4096.0),
        (RPM, 60.0),
        (0xFDB44700, 60_000.0),
        (RPS, 1.0),
        (DEGREES_PER_S, 360.0),
    ],
)
def test_velocities_in_a_revolution_a_second(unit, velocity):
    assert velocity_units({"velocity_unit": unit}.get, 4096) == velocity


@pytest.mark.parametrize(
    ("objects", "said"),
    [
        ({}, "a unit that is not known here"),
        (ENCODER | {"position_unit": 0x00010000}, "60A8h is 0x00010000"),
        (ENCODER | {"encoder_turns": 3}, "no whole number"),
    ],
)
def test_what_is_not_understood_is_refused(objects, said):
    with pytest.raises(DeviceError, match=said):
        counts_per_revolution(objects.get)


def test_a_time_that_is_not_known_is_refused():
    with pytest.raises(DeviceError, match="neither a second nor a minute"):
        velocity_units({"velocity_unit": 0x00B44800}.get, 4096)
