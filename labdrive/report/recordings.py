"""A run's recordings: what each holds, and what it shows before any filter, in constant memory."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN
from labdrive.report.decimate import decimate

BLOCK = 1 << 20
Curve = tuple[FloatArray, FloatArray]

AXES = ("phase", "time")


@dataclass(frozen=True, eq=False)
class Residual:
    """Readings of `sensor` less their line, thinned: `off` [SI `unit`] over `cycles`."""

    sensor: str
    cycles: FloatArray
    off: FloatArray
    unit: str


def contents(path: Path) -> tuple[str, ...]:
    """Return label, direction, cycles, samples and sensors of a recording, or what is wrong."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return _contents(file)
    except (OSError, KeyError) as error:
        return (f"cannot be read: {error}", "", "", "", "")


def _contents(file: Any) -> tuple[str, ...]:
    def told(name: str) -> str:
        values = np.ravel(file.attrs.get(name, ""))  # netCDF keeps numbers as arrays of one
        return str(values[0])

    named = (f"{name} ({file[name].attrs.get('units', '?')})" for name in sensors(file))
    samples = f"{len(file['phase']):,}".replace(",", "\u202f")
    return told("label"), told("direction"), told("periods"), samples, ", ".join(named)


def sensors(file: Any) -> list[str]:
    """Return the names of an open recording's sensors."""
    return [name for name in file if name not in AXES and "units" in file[name].attrs]


def residual(path: Path, sensor: str | None, points: int) -> Residual | None:
    """Return a sensor's readings less their least-squares line over the phase.

    Without `sensor` it is the recording's first. None if there is no such recording or sensor, or
    nothing in it that is a number.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            name = sensor or sensors(file)[0]
            cycles, off = _less_line(file["phase"], file[name], points)
            return Residual(name, cycles, off, str(file[name].attrs.get("units", "")))
    except (OSError, KeyError, IndexError, ValueError):
        return None


def _less_line(phase: Any, reading: Any, points: int) -> Curve:
    """Return cycles and readings less their line, thinned; ValueError if there are none."""
    slope, centre, middle = _line(phase, reading)
    share = max(4, points * BLOCK // max(len(phase), BLOCK))
    pieces = [
        decimate(x / TURN, y - middle - slope * (x - centre), share)
        for x, y in _blocks(phase, reading)
    ]
    cycles, off = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return cycles, off


def _line(phase: Any, reading: Any) -> tuple[float, float, float]:
    """Return the slope of the line that fits best, and the phase and reading in its middle."""
    sums, origin = np.zeros(5), np.zeros(2)
    for block in _blocks(phase, reading):
        if not sums[0]:
            # Sums over numbers far from zero would lose the digits that matter.
            origin = np.array([column[0] for column in block])
        x, y = block[0] - origin[0], block[1] - origin[1]
        sums += np.array([len(x), x.sum(), y.sum(), x @ x, x @ y])
    _, sx, sy, sxx, sxy = sums / max(sums[0], 1.0)
    spread = sxx - sx**2
    slope = (sxy - sx * sy) / spread if spread > 0 else 0.0
    return slope, origin[0] + sx, origin[1] + sy


def _blocks(phase: Any, reading: Any) -> Iterator[Curve]:
    """Yield phases and readings a block at a time, without readings that are no number."""
    for start in range(0, len(phase), BLOCK):
        x, y = phase[start : start + BLOCK], reading[start : start + BLOCK]
        finite = np.isfinite(x) & np.isfinite(y)
        if finite.any():
            yield x[finite], y[finite]
