import pytest
from pydantic import ValidationError

from labdrive.interfaces.motion import MotionSettings
from labdrive.model.motion import Direction, Motion


def test_settings_make_a_motion():
    settings = MotionSettings(
        periods=3, samples_per_period=64, period_rate="500 mHz", direction="backward"
    )
    assert settings.motion() == Motion(3, 64, 0.5, 2, Direction.BACKWARD)
    assert settings.return_to_start


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (14, "must be 16 or more: fewer do not resolve the cycle"),
        (0, "must be 16 or more: fewer do not resolve the cycle"),
        (17, "must be even, such as 18: half a cycle is whole samples"),
    ],
)
def test_samples_must_resolve_the_cycle_and_its_half(samples, message):
    with pytest.raises(ValidationError, match=message):
        MotionSettings(samples_per_period=samples, period_rate="1 Hz")


@pytest.mark.parametrize(
    "field", [{"periods": 0}, {"settle_periods": -1}, {"period_rate": "0 Hz"}, {"spin": 1}]
)
def test_what_cannot_be_moved_is_refused(field):
    with pytest.raises(ValidationError):
        MotionSettings(**({"period_rate": "1 Hz"} | field))


def test_no_settling_is_a_choice():
    assert MotionSettings(settle_periods=0, period_rate="1 Hz").motion().settle_periods == 0
