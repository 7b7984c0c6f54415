"""Plays, their inverse, and voltages that make up for them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import InputError
from labdrive.periodic.hysteresis import PlayModel, steady_plays
from labdrive.periodic.leg_fit import loop_width
from labdrive.periodic.phase_map import node_phases

PHASE = node_phases(256)


@st.composite
def models(draw):
    count = draw(st.integers(1, 6))
    gaps = draw(st.lists(st.floats(0.2, 6), min_size=count, max_size=count))
    weights = draw(st.lists(st.floats(0, 0.3), min_size=count, max_size=count))
    return PlayModel(np.cumsum(gaps), np.array(weights))


@st.composite
def cycles(draw):
    """Return one cycle of a voltage, with several turning points."""
    waves = draw(st.lists(st.tuples(st.floats(1, 20), st.floats(0, 7)), min_size=1, max_size=3))
    return sum(a * np.sin(k * PHASE + b) for k, (a, b) in enumerate(waves, start=1))


@given(models(), cycles())
def test_the_inverse_undoes_the_model(model, U):
    np.testing.assert_allclose(model.inverse().steady(model.steady(U)), U, atol=1e-9)
    np.testing.assert_allclose(model.steady(model.inverse().steady(U)), U, atol=1e-9)


@given(models(), cycles())
def test_compensated_voltages_bring_the_shape_and_keep_the_extremes(model, U):
    V = model.compensated(U)
    assert V.min() == pytest.approx(U.min(), abs=1e-9)
    assert V.max() == pytest.approx(U.max(), abs=1e-9)
    out = model.steady(V)
    size = np.ptp(out) / np.ptp(U)
    np.testing.assert_allclose(out - out.mean(), size * (U - U.mean()), atol=1e-9)


@given(cycles(), st.floats(0.1, 30))
def test_a_play_stays_within_its_radius_and_moves_only_when_dragged(U, radius):
    play = steady_plays(U, [radius])[:, 0]
    assert np.all(np.abs(U - play) <= radius + 1e-12)
    moved = np.diff(np.append(play, play[0])) != 0
    following = np.append(U, U[0])[1:][moved] - np.append(play, play[0])[1:][moved]
    np.testing.assert_allclose(np.abs(following), radius)


def test_a_loop_is_as_wide_as_its_play_says():
    # Over a swing of 40 V a play of 5 V lags by 5 V to either side: 0.2 * 10 V of opening.
    model = PlayModel(np.array([5.0]), np.array([0.2]))
    U = 20 * np.sin(node_phases(4096))
    assert loop_width(U, model.steady(U)) == pytest.approx(2 / model.swing(40), rel=1e-3)


def test_weights_that_let_the_output_fall_are_refused():
    with pytest.raises(InputError, match="fall as the voltage rises"):
        PlayModel(np.array([1.0, 2.0]), np.array([0.1, -1.2]))
