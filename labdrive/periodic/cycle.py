"""Fitting the length of a cycle that is known only roughly, as a worm's period in a guide log."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.waveform import TURN
from labdrive.periodic.regression import Fit, Regression, solved

LEAST_CYCLES = 2.0
# How far from the guess, as a share of it, periods are looked for.
SEARCH = 0.1
MOST_STEPS = 50
ROUNDING = 1e-10


@dataclass(frozen=True)
class CycleFit:
    """Length of a cycle and its standard error, both in the unit of the running coordinate."""

    period: float
    standard_error: float


def fit_cycle(
    coordinate: FloatArray,
    position: FloatArray,
    guess: float,
    drift_order: int = 2,
    harmonics: int = 3,
) -> CycleFit:
    """Return the cycle that best explains `position` over a running `coordinate`, such as time.

    Least squares over the period together with a line, a polynomial drift of `drift_order` and
    `harmonics` of the cycle. The best of the periods within 10 % of `guess` is found on a grid
    fine enough for the highest harmonic, then polished by Gauss and Newton's method. Coordinate
    and position have shape (samples,); gaps and uneven sampling do no harm. The standard error
    takes the noise to be as strong as it is found near the harmonics.

    EstimationError if values are not finite, fewer than two cycles are there, or no period near
    the guess fits best.
    """
    _check(coordinate, position, guess)
    at = partial(_regression, coordinate, position, drift_order, harmonics)
    resolution = 1 / (harmonics * float(np.ptp(coordinate)))
    period = min(_periods_to_try(guess, resolution), key=lambda period: _left_over(at(period)))
    change = 1.0
    for _ in range(MOST_STEPS):
        regression = at(period)
        fit = regression.fit()
        with_period = solved(_with_period(regression, fit))
        change = float(with_period.solution[-1])
        if abs(change) < ROUNDING or abs(period / guess - 1) > SEARCH:
            break
        period *= 1 + change
    if abs(change) >= ROUNDING or abs(period / guess - 1) > SEARCH:
        raise EstimationError(
            f"no cycle within {SEARCH:.0%} of {guess:g} fits best; give a better guess"
        )
    return CycleFit(period, period * _relative_error(regression, fit, with_period))


def _regression(
    coordinate: FloatArray, position: FloatArray, drift_order: int, harmonics: int, period: float
) -> Regression:
    """Return the regression at a given period, phase zero in the middle.

    There the period is uncorrelated with the phases of the harmonics.
    """
    middle = (float(coordinate.min()) + float(coordinate.max())) / 2
    phase = TURN / period * (coordinate - middle)
    return Regression(phase, coordinate, position, harmonics, drift_order)


def _periods_to_try(guess: float, resolution: float) -> list[float]:
    """Return periods about the guess.

    Their frequencies are a quarter of the highest harmonic's resolution apart, so that none can
    step over its peak.
    """
    count = int(np.ceil(4 * SEARCH / (guess * resolution)))
    frequencies = np.linspace(1 / (1 + SEARCH), 1 / (1 - SEARCH), 2 * count + 1) / guess
    return [float(1 / frequency) for frequency in frequencies]


def _left_over(regression: Regression) -> float:
    """Return the sum of the squared residuals of the best fit."""
    fit = regression.fit()
    return sum(float(np.sum(regression.left(c, fit) ** 2)) for c in regression.chunks())


def _with_period(regression: Regression, fit: Fit) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the rows with one more column, what a relative change of the period does."""
    orders = np.arange(1, regression.order + 1)
    rates = 1j * orders * regression.harmonics(fit)
    for chunk in regression.chunks():
        phase = regression.phase[chunk]
        slope = np.real(np.exp(1j * np.outer(phase, orders)) @ rates)
        rows = np.column_stack([regression.rows(chunk), -phase * slope])
        yield rows, regression.left(chunk)


def _relative_error(regression: Regression, fit: Fit, with_period: Fit) -> float:
    """Return the relative standard error of the period: noise where its slope has its power."""
    orders = np.arange(1, regression.order + 1)
    weights = np.abs(orders * regression.harmonics(fit)) ** 2
    noise = regression.noise_at_harmonics(regression.noise(fit))
    return float(np.sqrt(np.average(noise, weights=weights) * with_period.inverse[-1, -1]))


def _check(coordinate: FloatArray, position: FloatArray, guess: float) -> None:
    """EstimationError unless there are finite values over cycles enough."""
    if not (np.isfinite(coordinate).all() and np.isfinite(position).all()):
        raise EstimationError("a cycle cannot be fitted to values that are not finite numbers")
    cycles = float(np.ptp(coordinate)) / guess if len(coordinate) else 0.0
    if cycles < LEAST_CYCLES:
        raise EstimationError(
            f"{cycles:.2g} cycles of {guess:g} do not determine a cycle's length; "
            f"at least {LEAST_CYCLES:g} are needed"
        )
