"""Conditions on readings and on the time of day."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from labdrive.engine.interlocks import Interlocks, PausedError
from labdrive.interfaces.devices import Reading
from labdrive.interfaces.interlocks import Interlock
from labdrive.model.errors import DeviceError, InterlockError

readings = st.lists(st.floats(-100, 100), min_size=1, max_size=20).map(np.array)


def interlock(**fields):
    return Interlock.model_validate(fields)


@given(readings, st.floats(-50, 50))
def test_the_first_reading_that_breaks_a_bound_is_found(values, bound):
    for name, breaks in (("below", values >= bound), ("above", values <= bound)):
        found = interlock(sensor="force", **{name: f"{bound!r} N"}).broken_at(values, 0.0)
        assert found == (int(np.argmax(breaks)) if breaks.any() else None)


@given(readings, st.floats(0, 50), st.floats(-50, 50))
def test_within_is_of_a_value_or_of_the_first_reading(values, width, middle):
    of_value = interlock(sensor="t", within=f"{width!r} K", of=f"{middle!r} K")
    of_first = interlock(sensor="t", within=f"{width!r} K")
    breaks = np.abs(values - middle) > width
    expected = int(np.argmax(breaks)) if breaks.any() else None
    assert of_value.broken_at(values, 1e9) == expected
    assert of_first.broken_at(values, middle) == expected


@given(st.integers(0, 1439), st.integers(0, 1439), st.integers(0, 1439))
def test_a_span_may_reach_over_midnight(start, end, now):
    def clock(minutes):
        return f"{minutes // 60:02d}:{minutes % 60:02d}"

    span = interlock(between=f"{clock(start)}-{clock(end)}")
    inside = start <= now < end if start <= end else now >= start or now < end
    assert span.holds_at(datetime(2026, 1, 1, now // 60, now % 60, tzinfo=UTC)) == inside


def test_the_time_of_day_is_the_benchs_own():
    span = interlock(between="22:00-06:00", tz="Europe/Berlin")
    assert span.holds_at(datetime(2026, 7, 1, 20, 30, tzinfo=UTC))
    assert not span.holds_at(datetime(2026, 1, 1, 20, 30, tzinfo=UTC))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "either a sensor or"),
        ({"sensor": "a"}, "one of below, above, within"),
        ({"sensor": "a", "below": "1 N", "above": "0 N"}, "one of below, above, within"),
        ({"between": "22:00-06:00", "below": "1 N"}, "belong to a sensor"),
        ({"sensor": "a", "below": "1 N", "of": "1 N"}, "belongs to within"),
        ({"between": "25:00-06:00"}, "write it as 22:00-06:00"),
        ({"between": "22:00-06:00", "tz": "Berlin"}, "no time zone"),
        ({"sensor": "a", "within": "1 N", "action": "hold"}, "no first reading"),
    ],
)
def test_what_is_no_condition_is_refused(fields, says):
    with pytest.raises(ValidationError, match=says):
        interlock(**fields)


def reading(*values):
    return Reading(np.array(values), 0.01 * np.arange(len(values)))


def test_each_action_does_what_it_says():
    now = datetime(2026, 1, 1, 12, tzinfo=UTC)
    clock = {"now": now}
    night = {"between": "22:00-06:00"}

    def at_work(*conditions):
        return Interlocks(
            [interlock(**one) for one in conditions], {"f": "N"}, lambda: clock["now"]
        )

    with pytest.raises(InterlockError, match=r"f read 5 N, the bench asks for f below 4 N.*20 ms"):
        at_work({"sensor": "f", "below": "4 N"}).check_reading("f", reading(1, 5, 2, 1))
    pausing = {"sensor": "f", "below": "4 N", "action": "pause", "again_after": "3 s"}
    with pytest.raises(PausedError) as paused:
        at_work(pausing).check_reading("f", reading(1, 5))
    assert paused.value.again_after == 3
    with pytest.raises(InterlockError, match="not started"):
        at_work(night).held_back_by()
    held = at_work({**night, "action": "hold"})
    assert held.held_back_by().reason == "the bench is to be used only 22:00-06:00 UTC"
    held.check_reading("f", reading(1))  # a recording under way goes on
    with pytest.raises(PausedError):
        at_work({**night, "action": "pause"}).check_reading("f", reading(1))
    cold = {"sensor": "f", "below": "4 N", "action": "hold"}
    gauge = SimpleNamespace(read_at_rest=lambda: clock["force"])
    waiting = Interlocks([interlock(**cold)], {"f": "N"}, at_rest={"f": gauge})
    clock["force"] = 5.0
    assert waiting.held_back_by().reason == "f reads 5 N, the bench asks for f below 4 N"
    waiting.check_reading("f", reading(1, 5))  # as above
    clock["force"] = 3.0
    assert waiting.held_back_by() is None
    clock["now"] += timedelta(hours=11)
    assert held.held_back_by() is None


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sensor_that_reads_no_number_at_rest_lets_nothing_begin(value):
    cold = interlock(sensor="f", below="4 N", action="hold")
    gauge = SimpleNamespace(read_at_rest=lambda: value)
    with pytest.raises(DeviceError, match=f"sensor f read {value} at rest"):
        Interlocks([cold], {"f": "N"}, at_rest={"f": gauge}).held_back_by()
