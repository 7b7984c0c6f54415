import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.model.errors import EstimationError, NonMonotonicError
from labdrive.periodic.linearize import half_period_symmetric, linearizing_map
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.response import Response

TURN = 2 * np.pi


def response(harmonics, step=5e-6):
    harmonics = np.asarray(harmonics, dtype=complex)
    return Response(step, harmonics, np.zeros(len(harmonics)), "m", "exact", 0.0)


@st.composite
def rising_responses(draw):
    """Harmonics of any shape whose slopes together stay below the mean slope."""
    unit = st.complex_numbers(max_magnitude=1, allow_nan=False)
    shape = draw(arrays(complex, st.integers(1, 20), elements=unit))
    orders = np.arange(1, len(shape) + 1)
    steepest = max(np.sum(orders * np.abs(shape)), 1e-3)
    step = draw(st.sampled_from([5e-6, -5e-6, 1e-3, 2.0]))
    share = draw(st.floats(0, 0.95))
    return response(shape * share * abs(step) / TURN / steepest, step)


@settings(deadline=None, max_examples=40)
@given(rising_responses())
def test_the_map_solves_the_equation_at_every_node(a):
    psi = linearizing_map(a)
    straight = a.step_size * node_phases(psi.length) / TURN
    assert np.abs(a.position(psi.nodes) - straight).max() < 1e-14 * abs(a.step_size)
    assert psi.nodes[0] == 0


def test_many_harmonics_are_inverted_as_well():
    rng = np.random.default_rng(2)
    harmonics = rng.normal(size=(2000, 2)) @ [1, 1j] * 5e-6 / TURN * 0.2 / 2000 / np.sqrt(2000)
    psi = linearizing_map(response(harmonics))
    straight = 5e-6 * node_phases(psi.length) / TURN
    assert np.abs(response(harmonics).position(psi.nodes) - straight).max() < 1e-19


BACKWARD = [0.4e-6, 0.5e-6j]


def test_a_response_that_runs_backwards_is_refused_with_its_phases_and_the_cure():
    a = response(BACKWARD)
    with pytest.raises(NonMonotonicError, match="on_nonmonotonic: limit") as caught:
        linearizing_map(a)
    assert len(caught.value.phases) == 2
    for start, end in caught.value.phases:
        inside = np.linspace(start, end, 20)[1:-1]
        assert np.all(a.slope(inside) < 0)
        assert a.slope(np.array(start - 1e-3)) > 0
        assert a.slope(np.array(end + 1e-3)) > 0
    named = re.findall(r"([\d.]+) to ([\d.]+) deg", str(caught.value))
    degrees = np.degrees(caught.value.phases) % 360
    np.testing.assert_allclose(np.array(named, dtype=float), degrees, atol=0.06)


@pytest.mark.parametrize("centre", [0.0, 0.01, 1.0, TURN - 0.01])
def test_a_backward_stretch_may_straddle_the_start_of_the_cycle(centre):
    # e = -a sin(phi - centre) is steepest downwards at the centre.
    a = response([5e-6 / TURN * 1.2 * 1j * np.exp(-1j * centre)])
    with pytest.raises(NonMonotonicError) as caught:
        linearizing_map(a)
    ((start, end),) = caught.value.phases
    assert np.angle(np.exp(1j * ((end + start) / 2 - centre))) == pytest.approx(0, abs=1e-3)
    assert (end - start) / 2 == pytest.approx(np.arccos(1 / 1.2), abs=1e-3)


@pytest.mark.parametrize("step", [5e-6, -5e-6])
@pytest.mark.parametrize("least_slope", [0.1, 0.3])
def test_limiting_straightens_all_but_the_neighbourhood_of_backward_stretches(step, least_slope):
    a = response(BACKWARD, step)
    psi = linearizing_map(a, "limit", least_slope)
    steepest = np.diff(np.append(psi.nodes, TURN)).max() * psi.length / TURN
    assert steepest == pytest.approx(1 / least_slope, rel=1e-3)
    assert psi.nodes[0] == 0
    phase = node_phases(psi.length)
    left = a.position(psi.nodes) - step * phase / TURN
    assert np.ptp(left) < a.periodic_error.pv / 2
    slopes = np.gradient(left, phase) * TURN / step
    assert np.mean(np.abs(slopes) < 1e-3) > 0.4


def test_limiting_keeps_phase_zero_even_where_the_response_runs_backwards_there():
    a = response([5e-6 / TURN * 1.2j])
    psi = linearizing_map(a, "limit")
    assert psi.nodes[0] == 0
    left = a.position(psi.nodes) - 5e-6 * node_phases(psi.length) / TURN
    assert np.ptp(left) < a.periodic_error.pv / 2


@settings(deadline=None, max_examples=20)
@given(rising_responses())
def test_limiting_changes_nothing_where_the_response_rises(a):
    free, limited = linearizing_map(a), linearizing_map(a, "limit")
    np.testing.assert_array_equal(limited.nodes, free.nodes)


def test_an_actuator_that_goes_nowhere_cannot_be_linearized():
    with pytest.raises(EstimationError, match="gains nothing"):
        linearizing_map(response([1e-6], step=0.0))


def test_the_symmetric_part_repeats_every_half_cycle():
    a = response([1e-7, 2e-7j, 3e-7, 4e-8])
    symmetric = half_period_symmetric(a)
    np.testing.assert_array_equal(symmetric.harmonics, [0, 2e-7j, 0, 4e-8])
    psi = linearizing_map(symmetric)
    phase = np.linspace(0, TURN, 100)
    np.testing.assert_allclose(psi(phase + np.pi), psi(phase) + np.pi, atol=1e-12)


def test_updates_compose_to_the_map_of_the_whole():
    # A memoryless plant seen through psi_1 shows A(psi_1(phi)); its own map is psi_2, innermost.
    a = response([1e-7, 5e-8j, 2e-8])
    whole = linearizing_map(a)
    rough = PhaseMap(node_phases(whole.length) + 0.7 * whole.deviation)
    left = a.position(rough.nodes) - a.step_size * node_phases(rough.length) / TURN
    spectrum = np.fft.rfft(left)[1:200] * 2 / rough.length
    update = linearizing_map(response(spectrum))
    np.testing.assert_allclose(rough.after(update).nodes, whole.nodes, atol=1e-7)
