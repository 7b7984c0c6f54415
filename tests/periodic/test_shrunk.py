"""Shrinking harmonics by the noise in them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.periodic.response import Response


def response(harmonics, standard_error):
    harmonics = np.asarray(harmonics, dtype=complex)
    errors = np.full(len(harmonics), standard_error)
    return Response(1.0, harmonics, errors, "m", "exact", 0.0)


def test_of_noise_alone_less_than_half_is_left():
    random = np.random.default_rng(1)
    noise = random.normal(size=20000) + 1j * random.normal(size=20000)
    left = response(noise, 1.0).shrunk().harmonics
    # Of exponentially distributed power x, (1 - 1/x)^2 x above 1 is left: E_1(1) = 0.2194.
    assert np.mean(np.abs(left) ** 2) / 2 == pytest.approx(0.2194, rel=0.05)


def test_what_stands_out_is_hardly_touched_and_keeps_its_phase():
    kept = response([3 + 4j], 0.05).shrunk().harmonics
    assert kept == pytest.approx([(3 + 4j) * (1 - 2 * 0.05**2 / 25)], rel=1e-12)


@given(
    st.lists(st.complex_numbers(max_magnitude=1e3, allow_nan=False), min_size=1, max_size=20),
    st.floats(0, 10),
)
def test_nothing_grows_and_nothing_turns(harmonics, standard_error):
    given_ = response(harmonics, standard_error)
    shrunk = given_.shrunk()
    assert np.all(np.abs(shrunk.harmonics) <= np.abs(given_.harmonics))
    assert np.all(np.real(shrunk.harmonics * given_.harmonics.conj()) >= 0)
    assert replace(shrunk, harmonics=given_.harmonics).periodic_error == given_.periodic_error


def test_without_noise_nothing_is_shrunk():
    exact = response([1e-12, 0.0, 5.0], 0.0)
    np.testing.assert_array_equal(exact.shrunk().harmonics, exact.harmonics)
