"""Step size against external load: compliance, onset of slip, stall load (paper, Figure 2c)."""

import math
from dataclasses import dataclass

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.periodic.measured import Measured

FEWEST_POINTS = 4
FEWEST_LINEAR = 3
STANDS_OUT = 3.0


@dataclass(frozen=True)
class LoadCurve:
    """What a drive does under load.

    Step without load [unit], compliance [unit / N] (how much shorter a step is for each newton),
    the loads [N] at which the legs begin to slip and at which the drive stalls; None where the
    loads did not reach that far. `linear` of the points, in order of load, are on the line.
    """

    unloaded: Measured
    compliance: Measured
    slip_onset: Measured | None
    stall_load: Measured | None
    linear: int


def load_curve(
    load: FloatArray,
    step: FloatArray,
    standard_error: FloatArray,
    linear_within: float = 0.01,
    stalled_below: float = 0.02,
) -> LoadCurve:
    """Return what points of a load curve say; `load` [N] rising, `step` and its errors [unit].

    Linear are as many of the first points, three at least, as a straight line fits to
    `linear_within` of the unloaded step or three standard errors, whichever is more. Slip begins
    where the curve, straight between points, leaves that line by as much; the drive stalls where
    the step falls below `stalled_below` of the unloaded one. The standard error of such a load is
    that of a place somewhere between two points, all places alike: their distance / sqrt(12).

    EstimationError for fewer than four points.
    """
    if len(load) < FEWEST_POINTS:
        raise EstimationError(f"{len(load)} loads are too few for a load curve; take 4 or more")
    tolerance = np.maximum(STANDS_OUT * standard_error, linear_within * abs(step[0]))
    linear = _linear_points(load, step, tolerance)
    line = _Line.through(load[:linear], step[:linear], standard_error[:linear])
    departure = (line.at(load) - step) / tolerance
    return LoadCurve(
        unloaded=Measured(line.intercept, line.intercept_error),
        compliance=Measured(-line.slope, line.slope_error),
        slip_onset=_crossing(load, departure - 1, linear - 1),
        stall_load=_stall(load, step, stalled_below),
        linear=linear,
    )


def stalled(step: float, unloaded: float, stalled_below: float = 0.02) -> bool:
    """Return whether a step is no step any more, next to that without load."""
    return step < stalled_below * unloaded


@dataclass(frozen=True)
class _Line:
    intercept: float
    slope: float
    intercept_error: float
    slope_error: float

    @classmethod
    def through(cls, x: FloatArray, y: FloatArray, standard_error: FloatArray) -> "_Line":
        """Return the least-squares line; errors from the scatter about it or, if more, the given.

        Three points have one degree of freedom, so what they scatter says little by itself.
        """
        design = np.stack([np.ones_like(x), x], axis=1)
        inverse = np.linalg.inv(design.T @ design)
        solution = inverse @ design.T @ y
        residual = y - design @ solution
        scatter = float(residual @ residual) / (len(x) - 2)
        variance = max(scatter, float(np.mean(standard_error**2)))
        errors = np.sqrt(variance * np.diag(inverse))
        return cls(float(solution[0]), float(solution[1]), float(errors[0]), float(errors[1]))

    def at(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.intercept + self.slope * x)


def _linear_points(load: FloatArray, step: FloatArray, tolerance: FloatArray) -> int:
    """Return how many of the first points lie on one line."""
    count = FEWEST_LINEAR
    while count < len(load):
        more = slice(0, count + 1)
        line = _Line.through(load[more], step[more], tolerance[more])
        if np.any(np.abs(line.at(load[more]) - step[more]) > tolerance[more]):
            break
        count += 1
    return count


def _crossing(load: FloatArray, above: FloatArray, first: int) -> Measured | None:
    """Return the load at which `above` comes to be positive, after point `first`; None if never."""
    for i in range(first + 1, len(load)):
        if above[i] > 0:
            share = min(1.0, max(0.0, above[i - 1] / (above[i - 1] - above[i])))
            return _between(load, i, share)
    return None


def _stall(load: FloatArray, step: FloatArray, stalled_below: float) -> Measured | None:
    """Return the load half-way between the last step and the first that is none; None if never."""
    at = [stalled(s, float(step[0]), stalled_below) for s in step.tolist()]
    return _between(load, at.index(True), 0.5) if any(at) else None


def _between(load: FloatArray, i: int, share: float) -> Measured:
    """Return a load between points i - 1 and i."""
    low, high = float(load[i - 1]), float(load[i])
    return Measured(low + share * (high - low), abs(high - low) / math.sqrt(12))
