import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.periodic.phase_map import PhaseMap, node_phases

TURN = 2 * np.pi


@st.composite
def maps(draw, length=64):
    """Any rising map: positive steps scaled to one turn, from any start."""
    steps = draw(arrays(float, length, elements=st.floats(0.05, 1)))
    start = draw(st.floats(-10, 10))
    return PhaseMap(start + TURN * (np.cumsum(steps) - steps[0]) / steps.sum())


phases = arrays(float, st.integers(1, 20), elements=st.floats(-50, 50))


@given(maps(), phases)
def test_a_map_gains_a_turn_in_a_turn_and_rises(psi, phase):
    np.testing.assert_allclose(psi(phase + TURN), psi(phase) + TURN, atol=1e-12)
    assert np.all(np.diff(psi(np.linspace(-7, 7, 501))) > 0)


@given(phases)
def test_identity_changes_nothing(phase):
    np.testing.assert_array_equal(PhaseMap.identity(128)(phase), phase)


@given(maps())
def test_a_map_and_its_inverse_undo_each_other_at_the_nodes(psi):
    np.testing.assert_allclose(psi(psi.inverse().nodes), node_phases(64), atol=1e-12)
    np.testing.assert_allclose(psi.after(psi.inverse()).deviation, 0, atol=1e-12)


@given(maps(), maps(), phases)
def test_composition_applies_the_inner_map_first(a, b, phase):
    np.testing.assert_allclose(a.after(b).nodes, a(b(node_phases(64))), atol=1e-12)
    identity = PhaseMap.identity(64)
    np.testing.assert_allclose(a.after(identity)(phase), a(phase), atol=1e-12)


def test_a_spindle_map_is_resolved_far_below_its_noise():
    def psi(phase):
        return phase + 0.013 * np.sin(20 * phase + 0.3)

    dense = np.linspace(0, TURN, 300_001)
    sampled = PhaseMap(psi(node_phases(16384)))
    assert np.abs(sampled(dense) - psi(dense)).max() < 1.2e-7
    assert np.abs(sampled.inverse()(psi(dense)) - dense).max() < 3e-7
    assert np.abs(sampled.after(sampled)(dense) - psi(psi(dense))).max() < 6e-7


@pytest.mark.parametrize(
    "nodes",
    [[0, 1, 1, 3], [0, 3, 2, 5], [0, 1, 2, 6.3], [0, np.nan, 2, 3], [0, 2, 4, TURN]],
)
def test_nodes_that_do_not_rise_are_refused(nodes):
    with pytest.raises(ValueError, match="rise strictly"):
        PhaseMap(np.array(nodes, dtype=float))
