import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.model.errors import EstimationError
from labdrive.model.recording import Sampling
from labdrive.periodic.estimate import estimate
from labdrive.periodic.linearize import linearizing_map
from labdrive.periodic.phase_map import PhaseMap, node_phases

TURN = 2 * np.pi
EITHER_WAY = pytest.mark.parametrize("sign", [1, -1])
amplitudes = st.complex_numbers(max_magnitude=1, allow_nan=False, allow_infinity=False)


@settings(deadline=None, max_examples=40)
@given(
    harmonics=arrays(complex, 7, elements=amplitudes),
    m=st.sampled_from([16, 17, 24, 256]),
    cycles=st.integers(2, 20),
    start=st.floats(-10, 10),
    sign=st.sampled_from([1, -1]),
    step=st.floats(-10, 10),
    offset=st.floats(-100, 100),
)
@pytest.mark.parametrize("estimator", ["exact", "least_squares"])
def test_known_harmonics_are_recovered(
    estimator, recording_of, grid, position_at, harmonics, m, cycles, start, sign, step, offset
):
    phase = grid(m, cycles, start, sign)
    recording = recording_of(phase, position_at(phase, step, harmonics, offset), m)
    response = estimate(recording, "ruler", estimator, harmonics=7)
    np.testing.assert_allclose(response.harmonics, harmonics, atol=1e-9)
    assert response.step_size == pytest.approx(step, abs=1e-9)
    assert (response.unit, response.estimator, response.order) == ("m", estimator, 7)


def test_all_harmonics_below_half_the_sampling_rate_are_estimated(recording_of, grid):
    for m, most in ((16, 7), (17, 8), (256, 127)):
        recording = recording_of(grid(m, 2), grid(m, 2), m)
        assert estimate(recording, "ruler").order == most


@EITHER_WAY
def test_the_printed_formula_is_that_of_the_appendix(recording_of, grid, sign):
    m, n = 16, 3
    phase = grid(m, n, sign=sign)
    position = np.random.default_rng(1).normal(size=len(phase))
    response = estimate(recording_of(phase, position, m), "ruler", "paper")
    # The appendix, term by term, for a phase that grows; a falling one is its mirror image.
    b = np.diff(position)
    k = np.arange(1, m // 2)
    c = np.array([np.sum(b * np.exp(-1j * TURN / m * np.arange(n * m) * one)) / n for one in k])
    dense = np.linspace(0, TURN, 50)
    turning = np.exp(1j * np.outer(dense - TURN / m / 2, k)) - np.exp(-0.5j * k * TURN / m)
    periodic = np.real(turning @ (c / (1j * np.pi * k)))
    line = response.step_size * sign * dense / TURN
    np.testing.assert_allclose(response.position(sign * dense), line + periodic, atol=1e-12)


def test_the_printed_formula_shrinks_harmonics_by_a_sinc(recording_of, grid, position_at):
    phase = grid(16, 4)
    recording = recording_of(phase, position_at(phase, 5, np.ones(7)), 16)
    shrunk = estimate(recording, "ruler", "paper").harmonics
    assert shrunk[0] == pytest.approx(0.9936, abs=5e-5)
    assert shrunk[6] == pytest.approx(0.7136, abs=5e-5)


def test_on_a_plant_without_memory_exact_is_done_in_one_pass_and_paper_stalls(
    recording_of, grid, position_at
):
    plant = np.array([0.15, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005])
    phase, dense = grid(16, 16), node_phases(4096)

    def residuals(estimator, passes):
        psi = PhaseMap.identity()
        for _ in range(passes):
            recording = recording_of(phase, position_at(psi(phase), TURN, plant), 16)
            psi = psi.after(linearizing_map(estimate(recording, "ruler", estimator)))
            yield np.std(position_at(psi(dense), TURN, plant) - dense)

    assert next(residuals("exact", 1)) < 1e-11
    paper = list(residuals("paper", 6))
    assert paper[0] == pytest.approx(4.5e-3, rel=0.05)
    assert paper[4] == pytest.approx(1.6e-3, rel=0.05)
    assert paper[5] == pytest.approx(paper[4], rel=0.01)


def weights(estimator, recording_of, phase, m):
    """Rows by which the estimator weighs positions: step, then real and imaginary parts."""
    columns = []
    for position in np.eye(len(phase)):
        found = estimate(recording_of(phase, position, m), "ruler", estimator, harmonics=m // 2 - 1)
        columns.append(np.r_[found.step_size, found.harmonics.real, found.harmonics.imag])
    return np.array(columns).T


def cramer_rao(phase, orders, covariance):
    """Bound of the covariance of constant, slope by cycle, cosines, sines."""
    angles = np.outer(phase, orders)
    model = np.column_stack([np.ones_like(phase), phase / TURN, np.cos(angles), -np.sin(angles)])
    return np.linalg.inv(model.T @ np.linalg.solve(covariance, model))


# Efficiency of k = 1, 2, 4 and of the step size. A walk starts anywhere: its first sample is wide.
EFFICIENCIES = [
    ("exact", "white", [0.952, 0.987, 0.996], 0.984),
    ("exact", "walk", [1, 1, 1], 0.837),
    ("least_squares", "white", [1, 1, 1], 1),
    ("least_squares", "walk", [0.833, 0.826, 0.802], 0.834),
]


@pytest.mark.parametrize(("estimator", "noise", "harmonics", "step"), EFFICIENCIES)
def test_efficiency_against_the_cramer_rao_bound(
    estimator, noise, harmonics, step, recording_of, grid
):
    m, phase, orders = 16, grid(16, 16), np.arange(1, 8)
    numbers = np.arange(len(phase))
    walk = np.minimum.outer(numbers, numbers) + 1e4
    covariance = np.eye(len(phase)) if noise == "white" else walk
    rows = weights(estimator, recording_of, phase, m)
    variances = np.einsum("ij,jk,ik->i", rows, covariance, rows)
    bound = np.diag(cramer_rao(phase, orders, covariance))[1:]
    both = [(v[1:8] + v[8:15])[[0, 1, 3]] for v in (bound, variances)]
    np.testing.assert_allclose(both[0] / both[1], harmonics, atol=0.004)
    assert bound[0] / variances[0] == pytest.approx(step, abs=0.01)


@pytest.mark.parametrize("white", [0.0, 1.0])
@pytest.mark.parametrize("walk", [0.0, 0.3])
@pytest.mark.parametrize(("estimator", "m", "cycles"), [("exact", 16, 16), ("exact", 64, 4)])
def test_standard_errors_are_the_scatter(
    estimator, m, cycles, white, walk, recording_of, grid, position_at
):
    if white == walk == 0:
        walk = 1e-3
    check_scatter(estimator, m, cycles, white, walk, recording_of, grid, position_at)


@pytest.mark.parametrize("white", [0.0, 1.0])
def test_standard_errors_of_least_squares_are_the_scatter(white, recording_of, grid, position_at):
    check_scatter("least_squares", 24, 12, white, 0.3, recording_of, grid, position_at)


def check_scatter(estimator, m, cycles, white, walk, recording_of, grid, position_at):
    rng, phase = np.random.default_rng(m + cycles), grid(m, cycles)
    clean = position_at(phase, 50, [20, 5j, 1])
    found = []
    for _ in range(200):
        noise = white * rng.normal(size=len(phase)) + walk * np.cumsum(rng.normal(size=len(phase)))
        found.append(estimate(recording_of(phase, clean + noise, m), "ruler", estimator))
    off = np.array([one.harmonics for one in found])
    off[:, :3] -= [20, 5j, 1]
    scatter = np.sqrt(np.mean(np.abs(off) ** 2, axis=0) / 2)
    reported = np.sqrt(np.mean([one.standard_errors**2 for one in found], axis=0))
    # 200 complex values: each scatter is known to 5 %.
    np.testing.assert_allclose(scatter / reported, 1, atol=0.25)
    assert np.mean(scatter / reported) == pytest.approx(1, abs=0.06)
    # The step's error leans on a walk that can hardly be seen: never below, at most 3 times.
    ratio = np.std([one.step_size for one in found]) / np.sqrt(
        np.mean([one.step_size_standard_error**2 for one in found])
    )
    assert 0.33 < ratio < 1.2


def test_standard_errors_follow_noise_of_another_colour(recording_of, grid, position_at):
    """A broad resonance at 5.5 periods a cycle: neither white nor a walk."""
    rng, phase = np.random.default_rng(7), grid(32, 64)
    pole = 0.9 * np.exp(2j * np.pi * 5.5 / 32)
    found = []
    for _ in range(100):
        noise = rng.normal(size=len(phase))
        ringing = np.zeros(len(phase))
        for j in range(2, len(phase)):
            ringing[j] = 2 * pole.real * ringing[j - 1] - abs(pole) ** 2 * ringing[j - 2] + noise[j]
        found.append(
            estimate(recording_of(phase, position_at(phase, 50, []) + ringing, 32), "ruler")
        )
    scatter = np.sqrt(np.mean([np.abs(one.harmonics) ** 2 / 2 for one in found], axis=0))
    reported = np.sqrt(np.mean([one.standard_errors**2 for one in found], axis=0))
    assert scatter.max() / scatter.min() > 5
    np.testing.assert_allclose(scatter / reported, 1, atol=0.25)


def test_noise_alone_is_seldom_taken_for_a_periodic_error(recording_of, grid):
    rng, phase = np.random.default_rng(9), grid(64, 16)
    noisy = [5 * phase + rng.normal(size=len(phase)) for _ in range(300)]
    alarms = [not estimate(recording_of(phase, a, 64), "ruler").at_noise_floor for a in noisy]
    assert np.mean(alarms) < 0.035


@pytest.mark.parametrize("n", [4, 16])
def test_sag_biases_the_first_harmonic_unless_it_is_fitted(n, recording_of, grid, position_at):
    phase = grid(256, n)
    x = phase / phase[-1]
    recording = recording_of(phase, position_at(phase, 5, [0.0]) + 4 * x * (1 - x), 256)
    biased = estimate(recording, "ruler", harmonics=1).harmonics[0]
    assert abs(biased) == pytest.approx(4 / (np.pi * n) ** 2, rel=1e-3)
    fitted = estimate(recording, "ruler", "least_squares", drift_order=2, harmonics=1)
    assert abs(fitted.harmonics[0]) < 1e-12


def test_a_wrong_period_turns_the_phase(recording_of, grid, position_at):
    phase = grid(64, 16)
    recording = recording_of(phase, position_at(phase * 1.001, 5, [1.0]), 64)
    turned = np.angle(estimate(recording, "ruler", "least_squares", harmonics=3).harmonics[0])
    assert np.degrees(turned) == pytest.approx(2.9, abs=0.05)


def faulty(recording_of, grid, fault):
    phase = grid(16, 4)
    good = recording_of(phase, phase.copy(), 16)
    if fault == "polled":
        return replace(good, sampling=Sampling.POLLED)
    if fault == "ragged":
        return recording_of(phase[:-3], phase[:-3], 16)
    if fault == "uneven":
        return recording_of(phase + 0.02 * np.sin(phase / 3), phase, 16)
    return recording_of(phase[:17], phase[:17], 16)


FAULTS = [
    ("polled", "polled.*least_squares"),
    ("ragged", "62 samples are not a whole number of cycles of 16.*least_squares"),
    ("uneven", "not equidistant by 2 pi/16.*least_squares"),
    ("single", "17 samples are less than two cycles of 16.*record more cycles$"),
]


@pytest.mark.parametrize("estimator", ["exact", "paper"])
@pytest.mark.parametrize(("fault", "message"), FAULTS)
def test_recordings_that_cannot_be_folded_are_refused(
    estimator, fault, message, recording_of, grid
):
    with pytest.raises(EstimationError, match=message):
        estimate(faulty(recording_of, grid, fault), "ruler", estimator)


@pytest.mark.parametrize("estimator", ["exact", "least_squares"])
def test_what_is_missing_is_named(estimator, recording_of, grid):
    phase = grid(16, 4)
    with pytest.raises(EstimationError, match="no sensor 'tape'; the recording has ruler"):
        estimate(recording_of(phase, phase, 16), "tape", estimator)
    holed = phase.copy()
    holed[37] = np.nan
    with pytest.raises(EstimationError, match="ruler holds nan at sample 37"):
        estimate(recording_of(phase, holed, 16), "ruler", estimator)


@pytest.mark.parametrize("harmonics", [0, 8])
def test_harmonics_that_the_samples_cannot_hold_are_refused(harmonics, recording_of, grid):
    recording = recording_of(grid(16, 4), grid(16, 4), 16)
    with pytest.raises(EstimationError, match=f"harmonics 1 to 7, but {harmonics} "):
        estimate(recording, "ruler", harmonics=harmonics)


@pytest.mark.slow
def test_a_long_recording_costs_at_most_three_sums(recording_of, grid):
    phase = grid(16, 2_000_000)
    recording = recording_of(phase, np.sin(phase) + phase, 16)

    def taken(call):
        start = time.perf_counter()
        call()
        return time.perf_counter() - start

    position = recording.readings["ruler"]
    reference = min(taken(position.sum) for _ in range(5))
    assert min(taken(lambda: estimate(recording, "ruler")) for _ in range(5)) < 3 * reference
