"""A number of the result over many runs, with control limits: shifts and drifts stand out.

An individuals chart (W. A. Shewhart; limits from the mean moving range, E. L. Grant and R. S.
Leavenworth, "Statistical Quality Control"), with the rules that one point beyond the limits, or
eight in a row to one side of the centre, are not chance.
"""

import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import StoreError
from labdrive.report.run_data import RunData

log = logging.getLogger(__name__)

BASELINE = 20
FEWEST = 5
# Of a normal spread, the mean moving range is 1.128 standard deviations.
LIMIT_PER_MOVING_RANGE = 3 / 1.128
IN_A_ROW = 8
# Of the centre: values that differ by less are the same, but for rounding.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Point:
    """One run's value [SI], when it began, and what is remarkable of it; "" if nothing."""

    run: str
    started: str
    value: float
    alarm: str = ""


@dataclass(frozen=True)
class Trend:
    """Points, oldest first, with the centre and control limits of the first of them."""

    metric: str
    unit: str
    points: list[Point]
    centre: float
    low: float
    high: float


def trend(root: Path, metric: str, bench: str | None, recipe: str | None) -> Trend | None:
    """Return the history of `metric`, as `periodic_error.rms`; None if fewer than five have it.

    Of an optimization it is that of the verification. `bench` and `recipe` are parts of their
    paths. The limits are those of the first twenty runs, so that they do not follow a drift. Runs
    whose files are damaged are logged and left out.
    """
    read = [_point(path.parent, metric, bench, recipe) for path in sorted(root.glob("*/run.json"))]
    found = [point for point, _ in filter(None, read)]
    unit = next((unit for _, unit in filter(None, reversed(read))), "")
    if len(found) < FEWEST:
        return None
    values = np.array([point.value for point in found])
    base = values[:BASELINE]
    centre = float(base.mean())
    reach = LIMIT_PER_MOVING_RANGE * float(np.abs(np.diff(base)).mean())
    low, high = centre - reach, centre + reach
    alarms = _alarms(values, centre, low, high)
    points = [
        Point(p.run, p.started, p.value, alarm) for p, alarm in zip(found, alarms, strict=True)
    ]
    return Trend(metric, unit, points, centre, low, high)


def numbers(run: RunData) -> dict[str, float]:
    """Return the finite numbers of a run's result by their dotted paths; StoreError if damaged.

    Of an optimization those of the verification.
    """
    return dict(_numbers(run.result.get("verification", run.result)))


def _numbers(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    if isinstance(value, dict):
        for name, inside in value.items():
            yield from _numbers(inside, f"{path}.{name}" if path else name)
    elif isinstance(value, int | float) and math.isfinite(value):
        yield path, float(value)


def _point(
    folder: Path, metric: str, bench: str | None, recipe: str | None
) -> tuple[Point, str] | None:
    """Return a run's point and unit; None if it is not done, is another's, or is damaged."""
    run = RunData(folder)
    try:
        if run.info.get("status") != "done" or not _fits(run.info, bench, recipe):
            return None
        value = numbers(run).get(metric)
    except (StoreError, OSError) as error:
        log.warning("%s is left out of the history: %s", folder.name, error)
        return None
    if value is None:
        return None
    point = Point(folder.name, str(run.info.get("started", "")), value)
    return point, str(run.result.get("unit", ""))


def _alarms(values: FloatArray, centre: float, low: float, high: float) -> Sequence[str]:
    """Return what is remarkable of each value."""
    alarms, side, row = [], 0, 0
    same = ROUNDING * abs(centre)
    for value in values.tolist():
        here = int(value > centre + same) - int(value < centre - same)
        row = row + 1 if here == side and here else 1
        side = here
        if not low - same <= value <= high + same:
            alarms.append("beyond the control limits")
        elif row >= IN_A_ROW:
            alarms.append(f"{row} in a row {'above' if side > 0 else 'below'} the centre")
        else:
            alarms.append("")
    return alarms


def _fits(info: dict[str, Any], bench: str | None, recipe: str | None) -> bool:
    wanted = ((bench, info.get("bench")), (recipe, info.get("recipe")))
    return all(part is None or part in str(path) for part, path in wanted)
