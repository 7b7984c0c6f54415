import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labdrive.periodic.fold import BLOCK_SAMPLES, fold


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from([3, 16, 17, 100, 256, 1025, 5000]),
    st.integers(2, 6000),
    st.integers(0, 2**32 - 1),
)
def test_folding_sums_the_differences_of_each_place_in_the_cycle(m, cycles, seed):
    cycles = max(2, min(cycles, 200_000 // m))
    rng = np.random.default_rng(seed)
    position = rng.normal(size=cycles * m + 1) + 3 * np.arange(cycles * m + 1) / m
    folded = fold(position, m)
    expected = np.diff(position).reshape(cycles, m).sum(axis=0)
    np.testing.assert_allclose(folded.differences, expected, atol=1e-9)
    assert folded.cycles == cycles
    assert folded.travel == position[-1] - position[0]


@settings(deadline=None, max_examples=40)
@given(st.sampled_from([16, 100, 1000]), st.integers(2, 300), st.integers(0, 2**32 - 1))
def test_the_step_is_a_line_through_the_means_of_the_cycles(m, cycles, seed):
    rng = np.random.default_rng(seed)
    position = rng.normal(size=cycles * m + 1)
    means = position[:-1].reshape(cycles, m).mean(axis=1)
    if cycles < 128:
        expected = np.polyfit(np.arange(cycles), means, 1)[0]
        assert fold(position, m).step == pytest.approx(expected, abs=1e-12)
    straight = (
        5.5 * np.arange(cycles * m + 1) / m
        + np.tile(means[0] * np.arange(m), cycles + 1)[: cycles * m + 1]
    )
    assert fold(straight, m).step == pytest.approx(5.5, abs=1e-9)


def test_far_from_the_origin_no_digits_are_lost_beyond_those_of_the_positions():
    m, cycles = 16, 50_000
    wave = np.cos(2 * np.pi * np.arange(m) / m) * 1e-3
    position = 1e3 + 5.0 * np.arange(m * cycles + 1) / m + np.append(np.tile(wave, cycles), wave[0])
    expected = 5.0 / m + np.diff(np.append(wave, wave[0]))
    resolution = np.spacing(position[-1])
    assert np.abs(fold(position, m).differences / cycles - expected).max() < resolution


@pytest.mark.parametrize("where", [0, 12_345, -1])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_shows(where, value):
    position = np.zeros(16 * 2000 + 1)
    position[where] = value
    folded = fold(position, 16)
    assert not (np.isfinite(folded.sums).all() and np.isfinite(folded.travel))


def test_memory_does_not_grow_with_the_recording():
    position = np.zeros(16 * 200_000 + 1)
    tracemalloc.start()
    fold(position, 16)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * 8 * BLOCK_SAMPLES
