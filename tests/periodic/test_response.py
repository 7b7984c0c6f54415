import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.periodic.response import Response

TURN = 2 * np.pi
harmonic_sets = arrays(
    complex, st.integers(1, 12), elements=st.complex_numbers(max_magnitude=1, allow_nan=False)
)


def response(harmonics, step=5.0, errors=0.0):
    harmonics = np.asarray(harmonics, dtype=complex)
    return Response(step, harmonics, np.full(len(harmonics), errors), "m", "exact", 0.0)


@given(harmonic_sets, st.floats(-20, 20))
def test_error_is_the_sum_of_its_harmonics(harmonics, phase):
    orders = np.arange(1, len(harmonics) + 1)
    expected = np.real(harmonics * np.exp(1j * orders * phase)).sum()
    a = response(harmonics)
    assert a.error(np.array(phase)) == pytest.approx(expected, abs=1e-12)
    np.testing.assert_allclose(a.position(phase + TURN) - a.position(phase), 5.0, atol=1e-11)
    assert a.position(np.array(0.0)) == pytest.approx(0, abs=1e-12)


@given(harmonic_sets)
def test_grids_agree_with_single_phases(harmonics):
    a = response(harmonics)
    phase = np.arange(64) * TURN / 64
    np.testing.assert_allclose(a.error_over_cycle(64), a.error(phase), atol=1e-12)
    nearby = (a.position(phase + 1e-5) - a.position(phase - 1e-5)) / 2e-5
    np.testing.assert_allclose(a.slope_over_cycle(64), nearby, atol=1e-6)
    np.testing.assert_allclose(a.slope(phase), a.slope_over_cycle(64), atol=1e-11)


def test_size_of_a_periodic_error():
    lone = response([0, 0, 0.3j]).periodic_error
    assert lone.rms == pytest.approx(0.3 / np.sqrt(2), rel=1e-12)
    assert lone.pv == pytest.approx(0.6, rel=1e-3)
    high = response(np.append(np.zeros(1999), 1)).periodic_error
    assert high.pv == pytest.approx(2, rel=2e-3)


def test_a_grid_too_coarse_for_the_harmonics_is_refused():
    with pytest.raises(ValueError, match="4 points cannot show 2"):
        response([1, 1]).error_over_cycle(4)


def test_only_harmonics_out_of_the_noise_are_significant():
    quiet = response([1.0, 0.02, 5.0], errors=0.01)
    np.testing.assert_array_equal(quiet.significant(), [True, False, True])
    assert not quiet.at_noise_floor
    assert response([0.01, 0.02j], errors=0.01).at_noise_floor
    assert quiet.noise_floor_rms == pytest.approx(0.01 * np.sqrt(3))


@pytest.mark.parametrize("bins", [16, np.inf])
@pytest.mark.parametrize("order", [1, 7, 127])
def test_noise_alone_raises_a_false_alarm_as_rarely_as_promised(order, bins):
    rng = np.random.default_rng(order)
    noise = rng.normal(size=(20_000 // order, order, 2)) @ [1, 1j]
    power = rng.gamma(bins, 1 / bins, noise.shape) if np.isfinite(bins) else np.ones(noise.shape)
    found = [
        Response(1.0, row, np.sqrt(local), "m", "exact", 0.0, bins)
        for row, local in zip(noise, power, strict=True)
    ]
    alarms = np.array([one.significant(0.05).any() for one in found])
    spread = np.sqrt(0.05 * 0.95 / len(alarms))
    assert alarms.mean() == pytest.approx(0.05, abs=4 * spread)


def test_noise_floor_is_the_rms_that_noise_shows():
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(400, 50, 2)) @ [1, 1j]
    power = [response(row).periodic_error.rms ** 2 for row in noise]
    floor = response(noise[0], errors=1.0).noise_floor_rms
    assert np.sqrt(np.mean(power)) == pytest.approx(floor, rel=0.02)
