import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import InputError
from labdrive.periodic.legs import LegModel, carried_height, predicted_step, walking_table
from labdrive.periodic.legs import tips as tips_of
from labdrive.periodic.trajectories import TRAJECTORIES

LT40 = LegModel.bending(0.036e-6, 0.025e-6)
CLAMP_SHEAR = LegModel(0, 0.05e-6, -0.02e-6, 0)
WAVEFORMS = ("ellipse", "triangle", "box")
ALL = pytest.mark.parametrize("trajectory", WAVEFORMS)
EITHER_LEG = pytest.mark.parametrize("legs", [LT40, CLAMP_SHEAR])
scales = st.floats(0.05, 1)


def volts(table):
    return np.array([channel.samples for channel in table.channels])


def tips(table, legs):
    U = volts(table)
    return (*legs.tip(U[0], U[1]), *legs.tip(U[2], U[3]))


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4), st.floats(-60, 60), st.floats(-60, 60))
def test_voltages_bring_the_tip_where_it_should_be(entries, U0, U1):
    legs = LegModel(2 + entries[0], entries[1], entries[2], 3 + entries[3])
    np.testing.assert_allclose(legs.voltages(*legs.tip(U0, U1)), [U0, U1], atol=1e-10)


def test_a_leg_that_moves_in_one_direction_only_is_refused():
    with pytest.raises(InputError, match="determinant is 0"):
        LegModel(1, 2, 2, 4)


@ALL
@EITHER_LEG
def test_voltages_fill_the_range_and_never_pass_it(trajectory, legs):
    table = walking_table(TRAJECTORIES[trajectory], legs, -10, 38)
    U = volts(table)
    assert U.min() >= -10
    assert U.max() <= 38
    assert np.ptp(U, axis=1).max() == pytest.approx(48, abs=1e-9)
    assert [channel.name for channel in table.channels] == ["U0", "U1", "U2", "U3"]
    assert [channel.unit for channel in table.channels] == ["V"] * 4
    assert [channel.group_phase for channel in table.channels] == [0, 0, np.pi, np.pi]


@ALL
@given(x_scale=scales, y_scale=scales)
def test_scales_shrink_the_strokes_about_the_middle_voltage(trajectory, x_scale, y_scale):
    full = tips(walking_table(TRAJECTORIES[trajectory], LT40, 0, 48), LT40)
    shape = TRAJECTORIES[trajectory]
    scale = {"x_scale": x_scale, "y_scale": y_scale}
    table = walking_table(shape, LT40, 0, 48, **scale, keep_pretension=False)
    scaled = tips(table, LT40)
    for axis, factor in zip(range(4), (x_scale, y_scale) * 2, strict=True):
        assert np.ptp(scaled[axis]) == pytest.approx(factor * np.ptp(full[axis]), rel=1e-9)
    U = volts(table)
    np.testing.assert_allclose((U.max(axis=1) + U.min(axis=1)) / 2, 24, atol=1e-9)
    assert U.min() >= 0
    assert U.max() <= 48


@ALL
@EITHER_LEG
@given(x_scale=scales, y_scale=scales)
def test_the_rod_is_held_as_high_whatever_the_scales(trajectory, legs, x_scale, y_scale):
    shape = TRAJECTORIES[trajectory]
    legs_and_range = (legs, 0, 48, 43)
    full = walking_table(shape, *legs_and_range, length=256)
    scaled = walking_table(shape, *legs_and_range, x_scale, y_scale, length=256)
    held = [carried_height(tips_of(table, legs)) for table in (full, scaled)]
    assert held[1] == pytest.approx(held[0], rel=1e-9)
    assert volts(scaled).min() >= 0
    assert volts(scaled).max() <= 48


def test_a_scaled_waveform_that_cannot_keep_the_pretension_is_refused():
    with pytest.raises(InputError, match=r"outside the bench's 0 to 48 V; set `pretension: free`"):
        walking_table(TRAJECTORIES["triangle"], LT40, 0, 48, y_scale=0.5)


@ALL
def test_a_smaller_swing_starts_at_the_lower_end(trajectory):
    U = volts(walking_table(TRAJECTORIES[trajectory], LT40, -10, 38, peak_to_peak=20))
    np.testing.assert_allclose([U.min(), U.max()], [-10, 10], atol=1e-9)


@ALL
@EITHER_LEG
def test_group_a_carries_towards_plus_x_about_phase_zero(trajectory, legs):
    x_a, y_a, _, y_b = tips(walking_table(TRAJECTORIES[trajectory], legs, 0, 48, length=4096), legs)
    inner = np.r_[-1000:1001]
    assert np.all(np.diff(x_a[inner]) > 0)
    assert np.all((y_a - y_b)[inner] > 0)
    assert np.all((y_a - y_b)[inner + 2048] < 0)


@ALL
def test_group_b_is_half_a_cycle_apart(trajectory):
    U = volts(walking_table(TRAJECTORIES[trajectory], LT40, 0, 48, length=512))
    np.testing.assert_allclose(U[2:], np.roll(U[:2], -256, axis=1), atol=1e-9)


def test_steps_are_twice_the_carrying_stroke():
    ellipse, triangle, box = (
        predicted_step(walking_table(TRAJECTORIES[name], LT40, 0, 48), LT40) for name in WAVEFORMS
    )
    # While carrying, the ellipse's x = 2 * 0.036 um/V * 24 V * sin(phi) / sqrt(2) sweeps both ways.
    assert ellipse == pytest.approx(4 * 2 * 0.036e-6 * 24 / np.sqrt(2), rel=1e-6)
    assert box < ellipse < triangle


def test_the_step_of_a_triangle_from_its_formula():
    table = walking_table(TRAJECTORIES["triangle"], LT40, 0, 48, length=8192)
    x_a = tips(table, LT40)[0]
    # x sweeps 3 sqrt(6)/4 of the half stroke over each group's half of the cycle.
    assert predicted_step(table, LT40) == pytest.approx(3 * np.sqrt(6) / 4 * np.ptp(x_a), rel=1e-5)


@pytest.mark.parametrize("swing", [0, -3, 48.1])
def test_a_swing_that_does_not_fit_is_refused(swing):
    with pytest.raises(InputError, match=f"waveform.amplitude: .*48 V.*got {swing:g} V"):
        walking_table(TRAJECTORIES["box"], LT40, 0, 48, peak_to_peak=swing)
