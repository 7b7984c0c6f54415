"""Fitting a leg's model to where its tip was seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import EstimationError
from labdrive.periodic.hysteresis import PlayModel
from labdrive.periodic.leg_fit import fit_axis, fit_plays
from labdrive.periodic.phase_map import node_phases

PHASE = node_phases(256)
U0, U1 = 24 + 24 * np.cos(PHASE - np.pi / 4), 24 + 24 * np.cos(PHASE + np.pi / 4)
coefficient = st.floats(1e-8, 1e-7)


def seen(a, b, cycles=8, noise=0.0, plays=None):
    """Return cycles of an axis [m] about their mean."""
    first, second = (U0, U1) if plays is None else (plays.steady(U0), plays.steady(U1))
    clean = a * first + b * second
    random = np.random.default_rng(0)
    return clean - clean.mean() + noise * random.normal(size=(cycles, len(PHASE)))


@given(a=coefficient, b=coefficient)
def test_each_geometry_finds_the_coefficients_it_allows(a, b):
    for geometry, axis, pair in (
        ("bending", "x", (a, -a)),
        ("bending", "y", (b, b)),
        ("stack", "x", (a, -a)),
        ("clamp_shear", "x", (0.0, a)),
        ("clamp_shear", "y", (b, 0.0)),
        ("free", "x", (a, -b)),
        ("free", "y", (b, a)),
    ):
        fit = fit_axis(seen(*pair), U0, U1, geometry, axis)
        assert [c.value for c in fit.coefficients] == pytest.approx(pair, rel=1e-9, abs=1e-20)
        assert fit.r_squared == pytest.approx(1)
        assert fit.loop_width < 1e-9


def test_a_wrong_geometry_fits_worse():
    cycles = seen(3e-8, -2e-8)
    assert fit_axis(cycles, U0, U1, "free", "x").r_squared == pytest.approx(1)
    assert fit_axis(cycles, U0, U1, "bending", "x").r_squared < 0.99


def test_standard_errors_are_the_scatter_of_many_identifications():
    random = np.random.default_rng(1)
    clean = 3e-8 * (U0 - U1)
    values, errors = [], []
    for _ in range(300):
        cycles = clean + 2e-9 * random.normal(size=(8, len(PHASE)))
        first = fit_axis(cycles, U0, U1, "free", "x").coefficients[0]
        values.append(first.value)
        errors.append(first.standard_error)
    assert np.mean(np.square(errors)) == pytest.approx(np.var(values), rel=0.3)


def test_the_plays_of_both_axes_are_found():
    plays = PlayModel(np.array([4.0, 8, 12, 16, 20]), np.array([0.05, 0, 0.1, 0, 0.08]))
    fits = {
        axis: fit_axis(seen(*pair, plays=plays), U0, U1, "bending", axis)
        for axis, pair in {"x": (3e-8, -3e-8), "y": (2e-8, 2e-8)}.items()
    }
    found = fit_plays(fits, U0, U1, plays=5)
    np.testing.assert_allclose(found.radii, plays.radii, rtol=1e-6)
    np.testing.assert_allclose(found.weights, plays.weights, atol=1e-6)


def test_voltages_that_say_nothing_and_a_single_cycle_are_refused():
    with pytest.raises(EstimationError, match="do not tell the coefficients apart"):
        fit_axis(seen(3e-8, 2e-8), U0, U0, "free", "x")
    with pytest.raises(EstimationError, match="record 2 or more"):
        fit_axis(seen(3e-8, 2e-8, cycles=1), U0, U1, "free", "x")
