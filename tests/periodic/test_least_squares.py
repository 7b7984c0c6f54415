import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labdrive.model.errors import EstimationError
from labdrive.model.recording import Sampling
from labdrive.periodic.estimate import estimate

TURN = 2 * np.pi


def polled(recording_of, position_at, rng, *, cycles, harmonics=(0.3, 0.1j, -0.05), drift=0.0):
    """Uneven samples with a gap, phases falling or rising by no whole number of cycles."""
    phase = np.sort(rng.uniform(0, TURN * cycles, int(60 * cycles)))
    phase = phase[(phase < TURN * cycles * 0.4) | (phase > TURN * cycles * 0.4 + 2)]
    time = phase / TURN + 100
    x = (time - time[0]) / (time[-1] - time[0])
    position = position_at(phase, 5.0, harmonics, 7.0) + drift * (x**2 - 2 * x**3)
    return recording_of(phase, position, 60, time=time, sampling=Sampling.POLLED)


@settings(deadline=None, max_examples=30)
@given(st.floats(1.3, 30), st.sampled_from([0, 1, 2, 3, 5]), st.integers(0, 2**32 - 1))
def test_uneven_gapped_samples_of_any_span_give_the_harmonics(
    recording_of, position_at, cycles, drift_order, seed
):
    rng = np.random.default_rng(seed)
    recording = polled(recording_of, position_at, rng, cycles=cycles)
    found = estimate(recording, "ruler", "least_squares", drift_order, harmonics=4)
    np.testing.assert_allclose(found.harmonics, [0.3, 0.1j, -0.05, 0], atol=1e-9)


def test_drift_of_the_fitted_order_is_removed_and_no_more(recording_of, position_at):
    rng = np.random.default_rng(1)
    recording = polled(recording_of, position_at, rng, cycles=7.3, drift=2.0)
    errors = [
        np.abs(
            estimate(recording, "ruler", "least_squares", order, 4).harmonics
            - [0.3, 0.1j, -0.05, 0]
        ).max()
        for order in (1, 2, 3)
    ]
    assert errors[0] > 1e-3
    assert errors[1] > 1e-3
    assert errors[2] < 1e-9


def test_standard_errors_are_the_scatter_on_uneven_samples(recording_of, position_at):
    rng = np.random.default_rng(2)
    recording = polled(recording_of, position_at, rng, cycles=9.4)
    clean, found = recording.readings["ruler"], []
    for _ in range(200):
        noisy = clean + 0.1 * rng.normal(size=len(clean))
        again = replace(recording, readings={"ruler": noisy})
        found.append(estimate(again, "ruler", "least_squares", 2, 6))
    off = np.array([one.harmonics for one in found]) - [0.3, 0.1j, -0.05, 0, 0, 0]
    scatter = np.sqrt(np.mean(np.abs(off) ** 2, axis=0) / 2)
    reported = np.sqrt(np.mean([one.standard_errors**2 for one in found], axis=0))
    np.testing.assert_allclose(scatter / reported, 1, atol=0.2)


def test_one_cycle_takes_its_errors_from_the_residuals(recording_of, grid, position_at):
    rng, phase = np.random.default_rng(3), grid(400, 1)
    found = []
    for _ in range(300):
        noisy = position_at(phase, 5, [1.0]) + 0.1 * rng.normal(size=len(phase))
        recording = recording_of(phase, noisy, 400)
        found.append(estimate(recording, "ruler", "least_squares", harmonics=3))
    off = np.array([one.harmonics for one in found]) - [1, 0, 0]
    scatter = np.sqrt(np.mean(np.abs(off) ** 2, axis=0) / 2)
    reported = np.sqrt(np.mean([one.standard_errors**2 for one in found], axis=0))
    np.testing.assert_allclose(scatter / reported, 1, atol=0.15)


def test_harmonics_default_to_a_quarter_of_the_samples_in_a_cycle(recording_of, grid):
    for m, order in ((4, 1), (40, 10), (1000, 64)):
        recording = recording_of(grid(m, 4), grid(m, 4), m)
        assert estimate(recording, "ruler", "least_squares").order == order


def test_long_recordings_are_fitted_in_constant_memory(recording_of, grid, position_at):
    peaks = []
    for cycles in (1000, 4000):
        phase = grid(100, cycles)
        recording = recording_of(phase, position_at(phase, 5, [0.3, 0.1j]), 100)
        tracemalloc.start()
        found = estimate(recording, "ruler", "least_squares", harmonics=10)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        np.testing.assert_allclose(found.harmonics[:2], [0.3, 0.1j], atol=1e-9)
    assert peaks[1] < 1.2 * peaks[0]


def test_too_short_a_recording_is_refused(recording_of, grid):
    phase = np.linspace(0, 0.9 * TURN, 100)
    with pytest.raises(EstimationError, match=r"0.9 cycles recorded; at least 1"):
        estimate(recording_of(phase, phase, 100), "ruler", "least_squares")
    phase = grid(16, 2)
    with pytest.raises(EstimationError, match="33 samples cannot determine 62 unknowns"):
        estimate(recording_of(phase, phase, 16), "ruler", "least_squares", harmonics=30)
    with pytest.raises(EstimationError, match="0 harmonics asked for"):
        estimate(recording_of(phase, phase, 16), "ruler", "least_squares", harmonics=0)


def test_harmonics_that_the_phases_do_not_tell_apart_are_refused(recording_of, grid):
    recording = recording_of(grid(16, 8), grid(16, 8), 16)
    with pytest.raises(EstimationError, match=r"walk: .*undetermined; ask for fewer harmonics"):
        estimate(recording, "ruler", "least_squares", harmonics=12)


def test_drift_needs_time(recording_of, grid):
    phase = grid(16, 8)
    still = recording_of(phase, phase, 16, time=np.zeros(len(phase)))
    assert estimate(still, "ruler", "least_squares", 1).step_size == pytest.approx(TURN)
    with pytest.raises(EstimationError, match="no time passes"):
        estimate(still, "ruler", "least_squares", 2)
    endless = recording_of(phase, phase, 16, time=np.append(phase[:-1], np.inf))
    with pytest.raises(EstimationError, match="time holds inf at sample 128"):
        estimate(endless, "ruler", "least_squares", 2)
