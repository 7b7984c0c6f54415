"""The five conditions on a trajectory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.periodic.conditions import conditions
from labdrive.periodic.trajectories import TRAJECTORIES


def broken(trajectory):
    return {one.number: one.found for one in conditions(trajectory) if not one.holds}


@pytest.mark.parametrize("name", ["triangle", "box"])
def test_the_papers_waveforms_fulfil_all_five(name):
    assert broken(TRAJECTORIES[name]) == {}


def test_the_ellipse_is_neither_even_nor_gentle():
    assert broken(TRAJECTORIES["ellipse"]) == {
        3: "off by up to 100%, at 90 deg",
        5: "both are as fast throughout",
    }


@given(st.sampled_from(["triangle", "box"]), st.floats(-3, 3), st.floats(1e-7, 10))
def test_neither_the_scale_nor_where_the_turn_begins_matters(name, shift, scale):
    def moved(phase):
        x, y = TRAJECTORIES[name](phase + shift)
        return scale * x, 3 * scale * y

    assert broken(moved) == {}


def test_what_does_not_repeat_is_found():
    assert 1 in broken(lambda phase: (0.1 * phase, np.cos(phase)))


def test_several_hand_overs_and_none_are_found():
    assert "3 times a turn" in broken(lambda phase: (np.sin(phase), np.cos(3 * phase)))[2]
    assert "0 times a turn" in broken(lambda phase: (np.sin(phase), 0 * phase))[2]


def test_a_carrying_tip_that_dips_is_found_with_its_phases():
    def dips(phase):
        x, y = TRAJECTORIES["box"](phase)
        return x, y - 3 * np.exp(-((np.mod(phase + np.pi, 2 * np.pi) - np.pi) ** 2) / 0.02)

    found = broken(dips)
    assert 2 in found


@given(st.floats(0.4, 1.1))
def test_a_kink_is_found_at_its_phase(kink):
    def kinked(phase):
        x, y = TRAJECTORIES["box"](phase)
        inside = np.mod(phase + np.pi, 2 * np.pi) - np.pi
        return x, y + 0.3 * np.minimum(np.abs(inside - kink), 0.2)

    at = float(broken(kinked)[4].partition("jumps at ")[2].split(" deg")[0].split(",")[0])
    places = [np.degrees(kink + d) for d in (-0.2, 0, 0.2)]
    assert min(abs(at - place) for place in places) < 0.2


def test_a_tip_that_lifts_while_it_carries_is_found():
    found = broken(
        lambda phase: (TRAJECTORIES["box"](phase)[0], -TRAJECTORIES["box"](phase + np.pi)[1])
    )
    assert 5 in found
