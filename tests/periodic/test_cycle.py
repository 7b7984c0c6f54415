import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labdrive.model.errors import EstimationError
from labdrive.periodic.cycle import fit_cycle

WORM = 382.5


def guide_log(rng, period=WORM, noise=0.0, cycles=5.7):
    """A worm's error [arcsec] over uneven times [s] with a gap and a slow drift."""
    time = np.cumsum(rng.uniform(2.8, 3.8, int(cycles * period / 3.3)))
    time = time[(time < 900) | (time > 1060)]
    turns = time / period
    error = 3.8 * np.cos(2 * np.pi * turns + 0.4) + 0.9 * np.sin(4 * np.pi * turns)
    drift = 2 + 3e-3 * time + 4e-7 * time**2
    return time, error + drift + noise * rng.normal(size=len(time))


@settings(deadline=None, max_examples=25)
@given(st.floats(350, 410), st.floats(-0.07, 0.07))
def test_a_clean_cycle_is_found_from_a_rough_guess(period, off):
    time, position = guide_log(np.random.default_rng(3), period)
    fit = fit_cycle(time, position, period * (1 + off))
    assert fit.period == pytest.approx(period, rel=1e-8)


def test_the_standard_error_is_the_scatter():
    rng = np.random.default_rng(4)
    fits = [fit_cycle(*guide_log(rng, noise=1.0), 375) for _ in range(150)]
    periods, errors = np.array([(fit.period, fit.standard_error) for fit in fits]).T
    assert periods.mean() == pytest.approx(WORM, abs=4 * periods.std() / np.sqrt(150))
    assert periods.std() == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.2)


def test_many_cycles_do_not_hide_the_peak_between_grid_points():
    rng = np.random.default_rng(5)
    time, position = guide_log(rng, 20.0, noise=0.1, cycles=60)
    assert fit_cycle(time, position, 21.0).period == pytest.approx(20.0, rel=1e-4)


def test_a_cycle_far_from_the_guess_is_an_error():
    with pytest.raises(EstimationError, match="within 10% of 470"):
        fit_cycle(*guide_log(np.random.default_rng(6)), 470)


def test_too_few_cycles_are_an_error():
    with pytest.raises(EstimationError, match="at least 2"):
        fit_cycle(*guide_log(np.random.default_rng(7)), 1200)


def test_values_that_are_not_finite_are_an_error():
    time, position = guide_log(np.random.default_rng(8))
    position[10] = np.nan
    with pytest.raises(EstimationError, match="not finite"):
        fit_cycle(time, position, WORM)
