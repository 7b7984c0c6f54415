"""Fit of a leg's linear model to where its tip was seen (paper, equation 1 and Figure 2a, b)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.periodic.hysteresis import PlayModel, steady_plays
from labdrive.periodic.measured import Measured

Geometry = Literal["bending", "clamp_shear", "stack", "free"]

DRIVES: Mapping[Geometry, Mapping[str, tuple[tuple[float, float], ...]]] = {
    "bending": {"x": ((1, -1),), "y": ((1, 1),)},
    "stack": {"x": ((1, -1),), "y": ((1, 1),)},
    "clamp_shear": {"x": ((0, 1),), "y": ((1, 0),)},
    "free": {"x": ((1, 0), (0, 1)), "y": ((1, 0), (0, 1))},
}
"""For each axis, the combinations of (U0, U1) that have a coefficient: the paper's constraints.

Two stacks in a V, as in a PICMAWalk, pull the tip apart and push it together as bending elements
do, so their constraint is the same; what differs is what the coefficients mean.
"""


@dataclass(frozen=True, eq=False)
class AxisFit:
    """One axis of the model: coefficients [m/V] against (U0, U1), and how well they do.

    `r_squared` is of the mean cycle. `loop_width` is the largest opening of the loop that the
    deflection makes over the voltage that drives it, as a share of the stroke. `mean` and
    `model` [m], shape (samples per period,), are the mean cycle and the model, both about 0;
    `drive` [V] is the voltage that drives it.
    """

    coefficients: tuple[Measured, Measured]
    r_squared: float
    loop_width: float
    drive: FloatArray
    mean: FloatArray
    model: FloatArray


def fit_axis(
    cycles: FloatArray, U0: FloatArray, U1: FloatArray, geometry: Geometry, axis: str
) -> AxisFit:
    """Fit one axis to what was seen over several cycles.

    `cycles` [m], shape (cycles, samples per period), with their mean and drift taken out; `U0` and
    `U1` [V], shape (samples per period,). The standard error of a coefficient is that of the mean
    of the cycles' own fits: what hysteresis adds is the same in each and not in it.
    EstimationError where a voltage does not move or there are fewer than two cycles.
    """
    if len(cycles) < 2:
        raise EstimationError("one cycle says nothing of its errors; record 2 or more")
    combined = [a * U0 + b * U1 for a, b in DRIVES[geometry][axis]]
    drives = np.stack([drive - drive.mean() for drive in combined], axis=1)
    if np.linalg.matrix_rank(drives) < drives.shape[1]:
        raise EstimationError(
            "the voltages do not tell the coefficients apart; take a trajectory that moves both"
        )
    solutions = np.linalg.lstsq(drives, cycles.T, rcond=None)[0]
    mean = cycles.mean(axis=0)
    model = drives @ solutions.mean(axis=1)
    drive = model / np.abs(_spread(solutions.mean(axis=1), geometry, axis)).max()
    return AxisFit(
        coefficients=_coefficients(solutions, geometry, axis),
        r_squared=float(1 - np.sum((mean - model) ** 2) / np.sum(mean**2)),
        loop_width=loop_width(drive, mean),
        drive=drive,
        mean=mean,
        model=model,
    )


def _spread(solution: FloatArray, geometry: Geometry, axis: str) -> FloatArray:
    """Return the coefficients of (U0, U1) that a solution stands for."""
    return np.asarray(np.array(DRIVES[geometry][axis]).T @ solution)


def _coefficients(
    solutions: FloatArray, geometry: Geometry, axis: str
) -> tuple[Measured, Measured]:
    each = np.array([_spread(one, geometry, axis) for one in solutions.T])
    errors = each.std(axis=0, ddof=1) / np.sqrt(len(each))
    first, second = zip(each.mean(axis=0).tolist(), errors.tolist(), strict=True)
    return Measured(*first), Measured(*second)


def loop_width(drive: FloatArray, deflection: FloatArray) -> float:
    """Return the largest opening of a loop, as a share of its stroke.

    `drive` and `deflection`, shape (n,), are one cycle, closed; the loop is cut at the extremes of
    `drive` into the way up and the way down.
    """
    start = int(np.argmin(drive))
    drive, deflection = np.roll(drive, -start), np.roll(deflection, -start)
    top = int(np.argmax(drive))
    drive, deflection = np.append(drive, drive[0]), np.append(deflection, deflection[0])
    up, down = slice(0, top + 1), slice(top, None)
    at = np.linspace(drive.min(), drive.max(), len(drive))
    rising = np.interp(at, np.maximum.accumulate(drive[up]), deflection[up])
    falling = np.interp(at, np.maximum.accumulate(drive[down][::-1]), deflection[down][::-1])
    return float(np.max(np.abs(rising - falling)) / np.ptp(deflection))


def fit_plays(
    fits: Mapping[str, AxisFit],
    U0: FloatArray,
    U1: FloatArray,
    plays: int,
) -> PlayModel:
    """Return the hysteresis that explains both axes, every element alike.

    Radii are equidistant up to where a play no longer moves; weights are not negative, by least
    squares (NNLS) on both axes in terms of their own linear coefficients.
    """
    from scipy.optimize import nnls

    radii = np.arange(1, plays + 1) * max(np.ptp(U0), np.ptp(U1)) / 2 / (plays + 1)
    rows, seen = [], []
    for fit in fits.values():
        a, b = (coefficient.value for coefficient in fit.coefficients)
        columns = np.column_stack(
            [a * U0 + b * U1, a * steady_plays(U0, radii) + b * steady_plays(U1, radii)]
        )
        size = np.ptp(fit.mean)
        rows.append((columns - columns.mean(axis=0)) / size)
        seen.append(fit.mean / size)
    found = nnls(np.concatenate(rows), np.concatenate(seen))[0]
    if found[0] <= 0:
        raise EstimationError("the loops are so wide that no play model with a linear part fits")
    return PlayModel(radii, found[1:] / found[0])
