"""Trajectories from a file: points of a leg's tip over the phase."""

import csv
from pathlib import Path

import numpy as np

from labdrive.interfaces.csv_cells import number
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.periodic.trajectories import Tip, Trajectory

COLUMNS = ("phase_deg", "x", "y")
FEWEST_POINTS = 8


def read_trajectory(path: Path) -> Trajectory:
    """Return the smooth, periodic curve through the points of a CSV file.

    Columns `phase_deg` (rising, less than a turn from first to last), `x` and `y` (any scale),
    named in the first line; the curve is the periodic cubic spline through the points.
    InputError with the line of what is wrong.
    """
    points = _points(path)
    phase, tips = np.deg2rad(points[:, 0]), points[:, 1:]
    from scipy.interpolate import CubicSpline

    closed = np.append(phase, phase[0] + 2 * np.pi), np.vstack((tips, tips[:1]))
    curve = CubicSpline(*closed, bc_type="periodic")

    def trajectory(phase: FloatArray) -> Tip:
        x_y = curve(phase)
        return x_y[..., 0], x_y[..., 1]

    return trajectory


def _points(path: Path) -> FloatArray:
    """Return the rows of the file, shape (n, 3)."""
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        rows = csv.reader(file, skipinitialspace=True)
        indices = _indices(path, next(rows, []))
        points: list[list[float]] = []
        for cells in filter(None, rows):
            points.append([number(path, rows.line_num, cells, *column) for column in indices])
            _refuse_phase(path, rows.line_num, points)
    if len(points) < FEWEST_POINTS:
        message = f"holds {len(points)} points; at least {FEWEST_POINTS} make a trajectory"
        raise InputError(Problem(message, file=str(path)))
    return np.array(points)


def _indices(path: Path, header: list[str]) -> list[tuple[str, int]]:
    names = [name.strip() for name in header]
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        message = f"the first line must name the columns {', '.join(COLUMNS)}; no {missing[0]!r}"
        raise InputError(Problem(message, file=str(path), line=1, got=",".join(names)))
    return [(name, names.index(name)) for name in COLUMNS]


def _refuse_phase(path: Path, line: int, points: list[list[float]]) -> None:
    """Refuse a last point whose phase does not go on from those before."""
    phases = [point[0] for point in points]
    if len(phases) > 1 and phases[-1] <= phases[-2]:
        message = f"phase_deg must rise from line to line; the one before is {phases[-2]:g}"
    elif phases[-1] - phases[0] >= 360:
        message = "phase_deg comes round to the first point again; leave the last one out"
    else:
        return
    raise InputError(Problem(message, file=str(path), line=line, got=f"{phases[-1]:g}"))
