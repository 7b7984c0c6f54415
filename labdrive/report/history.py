"""A number of the result over many runs, with control limits: shifts and drifts stand out.

An individuals chart (W. A. Shewhart; limits from the mean moving range, E. L. Grant and R. S.
Leavenworth, "Statistical Quality Control"), with the rules that one point beyond the limits, or
eight in a row to one side of the centre, are not chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.run_data import RunData

BASELINE = 20
FEWEST = 5
# Of a normal spread, the mean moving range is 1.128 standard deviations.
LIMIT_PER_MOVING_RANGE = 3 / 1.128
IN_A_ROW = 8


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
    paths. The limits are those of the first twenty runs, so that they do not follow a drift.
    """
    found: list[Point] = []
    unit = ""
    for path in sorted(root.glob("*/run.json")):
        run = RunData(path.parent)
        if run.info.get("status") != "done" or not _fits(run.info, bench, recipe):
            continue
        value = _value(run.result.get("verification", run.result), metric)
        if value is not None:
            unit = str(run.result.get("unit", ""))
            found.append(Point(path.parent.name, str(run.info.get("started", "")), value))
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


def _alarms(values: FloatArray, centre: float, low: float, high: float) -> Sequence[str]:
    """Return what is remarkable of each value."""
    alarms, side, row = [], 0, 0
    for value in values.tolist():
        here = int(value > centre) - int(value < centre)
        row = row + 1 if here == side and here else 1
        side = here
        if not low <= value <= high:
            alarms.append("beyond the control limits")
        elif row >= IN_A_ROW:
            alarms.append(f"{row} in a row {'above' if side > 0 else 'below'} the centre")
        else:
            alarms.append("")
    return alarms


def _fits(info: dict[str, Any], bench: str | None, recipe: str | None) -> bool:
    wanted = ((bench, info.get("bench")), (recipe, info.get("recipe")))
    return all(part is None or part in str(path) for part, path in wanted)


def _value(result: Any, metric: str) -> float | None:
    """Return the number at a dotted path, None if there is none."""
    for part in metric.split("."):
        result = result.get(part) if isinstance(result, dict) else None
    return float(result) if isinstance(result, int | float) else None
