"""The five conditions on a trajectory that should move a rod steadily (paper, Methods)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN
from labdrive.periodic.phase_map import node_phases
from labdrive.periodic.trajectories import Trajectory

GRID = 7200
FINER = 4
# A share of the largest value that counts as rounding, or as unevenness nobody would see.
SLIGHT = 1e-6
EVEN_WITHIN = 0.01
KINK_LEFT = 0.5


@dataclass(frozen=True)
class Condition:
    """One condition: what it asks for, whether it holds, and if not where and by how much."""

    number: int
    asks: str
    holds: bool
    found: str = ""


def conditions(trajectory: Trajectory) -> list[Condition]:
    """Check a trajectory's five conditions, in the paper's order.

    Group A carries from the phase phi_0 at which its tip comes to be the higher one; where there is
    no such phase, conditions 3 and 5 cannot be checked and do not hold.
    """
    x, y = trajectory(node_phases(GRID))
    carrying = _carrying(y)
    return [
        _periodic(trajectory),
        _one_hand_over(y),
        _even(x, carrying),
        _smooth(trajectory),
        _gentle(y, carrying),
    ]


def _periodic(trajectory: Trajectory) -> Condition:
    """Condition 1: x and y repeat after a turn."""
    phase = node_phases(GRID)
    gaps = [
        np.abs(later - now) / max(np.ptp(now), np.finfo(float).tiny)
        for now, later in zip(trajectory(phase), trajectory(phase + TURN), strict=True)
    ]
    wrong = np.max(gaps, axis=0) > SLIGHT
    return Condition(1, "x and y repeat every turn", not wrong.any(), _spans(wrong))


def _one_hand_over(y: FloatArray) -> Condition:
    """Condition 2: the groups are level at one phase and half a turn on, A above in between."""
    asks = "one hand-over each way, the carrying tip above, the other below its height there"
    ups = _ups(y)
    if len(ups) != 1:
        found = f"group A comes to be the higher one {len(ups)} times a turn"
        return Condition(2, asks, holds=False, found=found)
    level = np.interp(ups[0] + 0.5, np.arange(GRID + 1), np.append(y, y[0]))
    above = np.zeros(GRID, dtype=bool)
    above[(ups[0] + 1 + np.arange(GRID // 2)) % GRID] = True
    slack = 2 * np.abs(np.diff(np.append(y, y[0]))).max()
    wrong = np.where(above, y < level - slack, y > level + slack)
    return Condition(2, asks, not wrong.any(), _spans(wrong))


def _even(x: FloatArray, carrying: NDArray[np.bool_]) -> Condition:
    """Condition 3: the carrying tip goes along the travel at constant speed."""
    asks = "constant speed along the travel while carrying"
    if not carrying.any():
        return Condition(3, asks, holds=False, found="there is no hand-over to begin from")
    speed = _slope(x)
    mean = float(speed[carrying].mean())
    off = np.abs(speed - mean) > EVEN_WITHIN * abs(mean)
    wrong = off & carrying
    if not wrong.any():
        return Condition(3, asks, holds=True)
    worst = int(np.argmax(np.where(carrying, np.abs(speed - mean), 0)))
    share = abs(speed[worst] / mean - 1) if mean else np.inf
    return Condition(
        3, asks, holds=False, found=f"off by up to {share:.0%}, at {worst * 360 / GRID:.0f} deg"
    )


def _smooth(trajectory: Trajectory) -> Condition:
    """Condition 4: x and y are continuously differentiable.

    A change of slope from one interval to the next shrinks with the interval unless it is a kink.
    """
    places = sorted({place for axis in (0, 1) for place in _kinks(trajectory, axis)})
    found = f"the slope jumps at {_listed(places)}" if places else ""
    return Condition(4, "continuously differentiable", not places, found)


def _kinks(trajectory: Trajectory, axis: int) -> Iterator[float]:
    """Yield the phases [deg] where the slope of x (axis 0) or y (axis 1) jumps."""
    coarse, fine = (
        np.abs(np.diff(slope, append=slope[:1]))
        for slope in (_slope(trajectory(node_phases(GRID * n))[axis]) for n in (1, FINER))
    )
    largest = np.abs(_slope(trajectory(node_phases(GRID))[axis])).max()
    # Of the finer changes that make up a coarse one, a kink is in one alone.
    rest = np.max([np.roll(fine, FINER - 1 - i)[::FINER] for i in range(2 * FINER)], axis=0)
    kinked = (coarse > 0.01 * largest) & (rest > KINK_LEFT * coarse)
    for index in np.flatnonzero(kinked & ~np.roll(kinked, 1)):
        yield round(float((index + 1) % GRID * 360 / GRID), 1)


def _gentle(y: FloatArray, carrying: NDArray[np.bool_]) -> Condition:
    """Condition 5: the carrying tip moves less across the travel than the other."""
    asks = "slower across the travel than the other group while carrying"
    if not carrying.any():
        return Condition(5, asks, holds=False, found="there is no hand-over to begin from")
    speed = np.abs(_slope(y))
    other = np.roll(speed, -GRID // 2)
    slack = EVEN_WITHIN * speed.max()
    wrong = carrying & (speed > other + slack)
    if wrong.any():
        return Condition(5, asks, holds=False, found=f"faster {_spans(wrong)}")
    if speed[carrying].mean() > (1 - EVEN_WITHIN) * other[carrying].mean():
        return Condition(5, asks, holds=False, found="both are as fast throughout")
    return Condition(5, asks, holds=True)


def _ups(y: FloatArray) -> NDArray[np.intp]:
    """Return the entries after which A comes to be the higher group."""
    lead = y - np.roll(y, -GRID // 2)
    higher = lead > SLIGHT * max(float(np.ptp(y)), np.finfo(float).tiny)
    return np.flatnonzero(~higher & np.roll(higher, -1))


def _carrying(y: FloatArray) -> NDArray[np.bool_]:
    """Return where group A carries: half a turn from its hand-over; nowhere without one."""
    carrying = np.zeros(GRID, dtype=bool)
    ups = _ups(y)
    if len(ups) == 1:
        # The intervals at both ends belong to neither group alone.
        carrying[(ups[0] + 1 + np.arange(1, GRID // 2 - 1)) % GRID] = True
    return carrying


def _slope(values: FloatArray) -> FloatArray:
    """Return d / d phase, half-way after each entry of a turn."""
    return np.asarray(np.diff(np.append(values, values[0])) * len(values) / TURN)


def _spans(wrong: NDArray[np.bool_]) -> str:
    """Return where something is wrong, as `from 10 to 20 deg`."""
    if not wrong.any():
        return ""
    if wrong.all():
        return "throughout"
    starts = np.flatnonzero(wrong & ~np.roll(wrong, 1))
    ends = np.flatnonzero(wrong & ~np.roll(wrong, -1))
    if ends[0] < starts[0]:
        ends = np.roll(ends, -1)
    degrees = 360 / GRID
    pairs = zip(starts.tolist(), ends.tolist(), strict=True)
    return _listed([f"from {a * degrees:.0f} to {b * degrees:.0f} deg" for a, b in pairs])


def _listed(places: list[float] | list[str]) -> str:
    texts = [place if isinstance(place, str) else f"{place:g} deg" for place in places]
    return ", ".join(texts[:4]) + (f" and {len(texts) - 4} more" if len(texts) > 4 else "")
