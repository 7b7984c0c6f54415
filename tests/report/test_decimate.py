"""Thinning a curve loses no extreme."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.report.decimate import decimate

CURVES = arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6))


@given(CURVES, st.integers(1, 50))
def test_extremes_and_order_are_kept_and_the_length_bounded(y, buckets):
    x = np.arange(len(y)) / 7
    thin_x, thin_y = decimate(x, y, buckets)
    assert len(thin_y) <= max(2 * buckets, 1)
    assert thin_y.min() == y.min()
    assert thin_y.max() == y.max()
    assert np.all(np.diff(thin_x) > 0)
    assert set(zip(thin_x, thin_y, strict=True)) <= set(zip(x, y, strict=True))


def test_a_spike_of_one_sample_in_a_million_is_still_there():
    y = np.zeros(1_000_000)
    y[123_456] = 1.0
    x, thin = decimate(np.arange(1_000_000.0), y, 500)
    assert x[np.argmax(thin)] == 123_456
