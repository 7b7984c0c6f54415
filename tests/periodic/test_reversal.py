"""The mirror of a waveform table, and switching to it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.periodic.legs import LegModel, tips, walking_table
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.reversal import swapped, switch_jump, switch_phase
from labdrive.periodic.trajectories import TRAJECTORIES
from labdrive.periodic.warp import warp

LEGS = LegModel.bending(0.036e-6, 0.025e-6)
TURN = 2 * np.pi

maps = st.lists(st.tuples(st.floats(-0.2, 0.2), st.floats(0, TURN)), min_size=1, max_size=4).map(
    lambda waves: PhaseMap(
        node_phases(4096)
        + sum(
            a / (k * len(waves)) * np.sin(k * node_phases(4096) + b)
            for k, (a, b) in enumerate(waves, start=1)
        )
    )
)
each = pytest.mark.parametrize("trajectory", ["ellipse", "triangle", "box"])


def tables(trajectory, psi):
    nominal = walking_table(TRAJECTORIES[trajectory], LEGS, 0, 48)
    forward = warp(nominal, psi, "shared_phase")
    return forward, swapped(forward)


@each
@given(psi=maps)
def test_in_the_mirror_legs_swing_the_other_way_and_lift_alike(trajectory, psi):
    forward, reverse = tables(trajectory, psi)
    there, back = tips(forward, LEGS), tips(reverse, LEGS)
    falling = -np.arange(forward.length) % forward.length
    for group in "AB":
        np.testing.assert_allclose(back[f"x_{group}"][falling], -there[f"x_{group}"], atol=1e-18)
        np.testing.assert_allclose(back[f"y_{group}"][falling], there[f"y_{group}"], atol=1e-18)


@each
@given(psi=maps, phase=st.floats(-20, 20))
def test_both_groups_keep_their_places_when_tables_are_switched_at_any_phase(
    trajectory, psi, phase
):
    forward, reverse = tables(trajectory, psi)
    go_on = switch_phase(psi, np.array([phase]))
    before = [channel.at(np.array([phase]))[0] for channel in forward.channels]
    after = [channel.at(go_on)[0] for channel in reverse.channels]
    # Between entries both tables are straight, 1 mV off at most.
    np.testing.assert_allclose(after, before, atol=1e-3)
    assert switch_jump(tips(forward, LEGS), tips(reverse, LEGS), psi) < 0.1e-9


@each
@given(psi=maps)
def test_the_mirror_of_the_mirror_is_the_table(trajectory, psi):
    forward, reverse = tables(trajectory, psi)
    for channel, again in zip(forward.channels, swapped(reverse).channels, strict=True):
        np.testing.assert_array_equal(again.samples, channel.samples)
        assert (again.name, again.group_phase) == (channel.name, channel.group_phase)


def test_going_on_at_the_same_phase_would_jump_unless_the_map_is_odd():
    phase = node_phases(4096)
    even = PhaseMap(phase + 0.2 * np.cos(phase))
    forward, reverse = tables("box", even)
    here = np.array([1.0])
    gap = forward.channel("U0").at(here) - reverse.channel("U0").at(here)
    assert abs(gap[0]) > 0.5
