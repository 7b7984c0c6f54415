"""Linearizing: the phase map that makes a response a straight line."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError, NonMonotonicError
from labdrive.model.waveform import TURN
from labdrive.periodic.phase_map import NODES, PhaseMap, node_phases
from labdrive.periodic.response import Response, dense_length

OnNonmonotonic = Literal["error", "limit"]
# Newton's method needs four steps; halving a bracket down to rounding needs fifty.
MOST_STEPS = 50
ROUNDING = 1e-14
MOST_NAMED = 4


def linearizing_map(
    response: Response, on_nonmonotonic: OnNonmonotonic = "error", least_slope: float = 0.05
) -> PhaseMap:
    """Return psi with A(psi(phi)) = step_size * phi / 2 pi and psi(0) = 0.

    The equation holds at every node to rounding. Where A runs backwards there is no such map:
    with `error` that is a NonMonotonicError; with `limit` A is replaced by the nearest curve (in
    least squares, over a grid) that rises by `least_slope` of its mean slope everywhere.
    EstimationError if the response gains nothing in a cycle.
    """
    if response.step_size == 0 or not np.isfinite(response.step_size):
        raise EstimationError("the actuator gains nothing in a cycle, so it cannot be linearized")
    length = max(NODES, dense_length(response.order))
    backward = response.slope_over_cycle(length) / response.step_size <= 0
    if backward.any() and on_nonmonotonic == "error":
        raise _non_monotonic(backward)
    if backward.any():
        return _limited(response, length, least_slope)
    return _inverted(response, length)


def half_period_symmetric(response: Response, groups: int = 2) -> Response:
    """Return the response with only those harmonics that `groups` equal groups would show.

    Its map repeats every cycle / `groups`, so that all groups can play one table.
    """
    kept = np.arange(1, response.order + 1) % groups == 0
    return replace(response, harmonics=np.where(kept, response.harmonics, 0))


def _travel(response: Response, length: int) -> FloatArray:
    """Return A in turns, 0 to 1, at phases 2 pi j / length and the end, shape (length + 1,)."""
    error = response.error_over_cycle(length) / response.step_size
    turns = np.arange(length + 1) / length
    return np.asarray(turns + np.append(error, error[0]) - error[0])


def _inverted(response: Response, length: int) -> PhaseMap:
    """Return the inverse of a rising response: Newton's method, kept in brackets from a grid."""
    target = node_phases(NODES) / TURN
    grid = np.arange(length + 1) * (TURN / length)
    travel = _travel(response, length)
    above = np.searchsorted(travel, target, side="right").clip(1, length)
    low, high = grid[above - 1], grid[above]
    psi = np.interp(target, travel, grid)
    for _ in range(MOST_STEPS):
        excess = response.position(psi) / response.step_size - target
        low, high = np.where(excess < 0, psi, low), np.where(excess > 0, psi, high)
        better = psi - excess * response.step_size / response.slope(psi)
        better = np.where((better < low) | (better > high), (low + high) / 2, better)
        change, psi = np.abs(better - psi).max(), better
        if change < ROUNDING:
            break
    psi[0] = 0
    return PhaseMap(psi)


def _limited(response: Response, length: int, least_slope: float) -> PhaseMap:
    """Return the inverse of the nearest curve that everywhere rises by the least slope."""
    from scipy.optimize import isotonic_regression

    # Isotonic regression knows no cycle: the middle one of three is free of the ends.
    turns = np.arange(3 * length) / length
    travel = np.concatenate([_travel(response, length)[:-1] + cycle for cycle in range(3)])
    rising = isotonic_regression(travel - least_slope * turns).x + least_slope * turns
    curve = rising[length : 2 * length + 1] - rising[length]
    grid = np.arange(length + 1) * (TURN / length)
    return PhaseMap(np.asarray(np.interp(node_phases(NODES) / TURN, curve, grid)))


def _non_monotonic(backward: NDArray[np.bool_]) -> NonMonotonicError:
    """Return the error that names the phases over which the response runs backwards."""
    phases = _runs(backward)
    named = [f"{np.degrees(a):.1f} to {np.degrees(b) % 360:.1f} deg" for a, b in phases]
    more = f" and {len(named) - MOST_NAMED} more stretches" if len(named) > MOST_NAMED else ""
    return NonMonotonicError(
        f"the response runs backwards from {', '.join(named[:MOST_NAMED])}{more}, so no phase map "
        "linearizes it; set `on_nonmonotonic: limit`, or choose another trajectory",
        phases,
    )


def _runs(flags: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return the stretches of phase (start, end) [rad] where flags over a cycle are set.

    A stretch that goes on into the next cycle ends beyond 2 pi.
    """
    if flags.all():
        return ((0.0, TURN),)
    starts = np.flatnonzero(flags & ~np.roll(flags, 1))
    ends = np.flatnonzero(flags & ~np.roll(flags, -1)) + 1
    ends = np.where(ends[0] <= starts[0], np.roll(ends, -1), ends)
    ends = ends + np.where(ends <= starts, len(flags), 0)
    scale = TURN / len(flags)
    return tuple(
        (a * scale, b * scale) for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
    )
