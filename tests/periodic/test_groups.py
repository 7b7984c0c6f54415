"""Gain and timing of two groups of legs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.periodic.groups import GroupCorrection, corrected, half_cycle_ratio, least_slope
from labdrive.periodic.legs import LegModel, tips, walking_table
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.response import Response
from labdrive.periodic.trajectories import TRAJECTORIES
from labdrive.periodic.warp import warp

LEGS = LegModel.bending(0.036e-6, 0.025e-6)
NOMINAL = walking_table(TRAJECTORIES["ellipse"], LEGS, 0, 48)
PSI = PhaseMap(node_phases(4096) + 0.2 * np.sin(node_phases(4096) + 0.3))
gains = st.floats(0.5, 2)
timings = st.floats(0, 0.5)


def samples(table):
    return np.array([channel.samples for channel in table.channels])


def response(harmonics):
    harmonics = np.asarray(harmonics, dtype=np.complex128)
    return Response(1.0, harmonics, np.zeros(len(harmonics)), "m", "exact", 0.0)


def test_nothing_of_its_own_is_the_shared_map():
    np.testing.assert_allclose(
        samples(corrected(NOMINAL, PSI, GroupCorrection())),
        samples(warp(NOMINAL, PSI, "shared_phase")),
        atol=1e-12,
    )


@given(gains, timings)
def test_voltages_never_leave_the_nominal_range(gain, timing):
    played = samples(corrected(NOMINAL, PSI, GroupCorrection(gain, timing)))
    assert played.min() >= samples(NOMINAL).min() - 1e-9
    assert played.max() <= samples(NOMINAL).max() + 1e-9


@given(gains)
def test_the_gain_is_the_second_groups_stroke_over_the_firsts(gain):
    tip = tips(corrected(NOMINAL, PhaseMap.identity(), GroupCorrection(gain)), LEGS)
    assert np.ptp(tip["x_B"]) / np.ptp(tip["x_A"]) == pytest.approx(gain, rel=1e-6)
    assert max(np.ptp(tip["x_B"]), np.ptp(tip["x_A"])) == pytest.approx(
        np.ptp(tips(NOMINAL, LEGS)["x_A"]), rel=1e-6
    )


@given(st.floats(0.05, 0.5))
def test_re_timed_groups_both_move_forward_where_they_change(timing):
    tip = tips(corrected(NOMINAL, PhaseMap.identity(), GroupCorrection(1.0, timing)), LEGS)
    change = 4096 // 4  # 90 deg, where A hands over to B
    for group in "AB":
        ahead = np.diff(tip[f"x_{group}"])[change - 2 : change + 2]
        assert np.all(ahead > 0)
    assert tip["y_A"][change] == pytest.approx(tip["y_B"][change], abs=1e-9)


@given(st.floats(-0.1, 0.1))
def test_the_ratio_of_half_cycles_is_that_of_their_travels(imbalance):
    # e = a sin(phi): A gains 2 a over its half cycle and gives it back over the other.
    ratio = half_cycle_ratio(response([-1j * imbalance]))
    assert ratio == pytest.approx((0.5 + 2 * imbalance) / (0.5 - 2 * imbalance))


@given(st.floats(0.01, 0.5))
def test_the_least_slope_is_of_the_mean(amplitude):
    found = least_slope(response([0, amplitude]))
    assert found == pytest.approx(1 - 2 * amplitude * 2 * np.pi, rel=1e-3, abs=1e-3)
