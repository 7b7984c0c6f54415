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
AXES = ("phase", "time")


@dataclass(frozen=True, eq=False)
class Residual:
    """Readings less their line, thinned for plotting: `off` [SI `unit`] over `cycles`."""

    cycles: FloatArray
    off: FloatArray
    unit: str


def contents(path: Path) -> tuple[str, ...]:
    """Return label, direction, cycles, samples and sensors of a recording, or what is wrong."""
    import h5py  # noqa: PLC0415 80 ms, needed where there are recordings only

    try:
        with h5py.File(path, "r") as file:
            return _contents(file)
    except (OSError, KeyError) as error:
        return (f"cannot be read: {error}", "", "", "", "")


def _contents(file: Any) -> tuple[str, ...]:  # noqa: ANN401 h5py carries no types
    def told(name: str) -> str:
        values = np.ravel(file.attrs.get(name, ""))  # netCDF keeps numbers as arrays of one
        return str(values[0])

    named = (f"{name} ({file[name].attrs.get('units', '?')})" for name in sensors(file))
    samples = f"{len(file['phase']):,}".replace(",", "\u202f")
    return told("label"), told("direction"), told("periods"), samples, ", ".join(named)


def sensors(file: Any) -> list[str]:  # noqa: ANN401
    """Return the names of an open recording's sensors."""
    return [name for name in file if name not in AXES and "units" in file[name].attrs]


def residual(path: Path, sensor: str | None, points: int) -> Residual | None:
    """Return a sensor's readings less their least-squares line over the phase.

    Without `sensor` it is the recording's first. None if there is no such recording or sensor.
    """
    import h5py  # noqa: PLC0415 80 ms, needed where there are recordings only

    try:
        with h5py.File(path, "r") as file:
            name = sensor or sensors(file)[0]
            unit = str(file[name].attrs.get("units", ""))
            return _residual(file["phase"], file[name], unit, points)
    except (OSError, KeyError, IndexError):
        return None


def _residual(phase: Any, reading: Any, unit: str, points: int) -> Residual | None:  # noqa: ANN401
    line = _line(phase, reading)
    share = max(4, points * BLOCK // max(len(phase), BLOCK))
    pieces = [
        decimate(x / TURN, y - np.polyval(line, x), share) for x, y in _blocks(phase, reading)
    ]
    if not pieces:
        return None
    cycles, off = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return Residual(cycles, off, unit)


def _line(phase: Any, reading: Any) -> FloatArray:  # noqa: ANN401
    """Return slope and value at phase 0 of the line that fits best."""
    sums = np.zeros(5)
    for x, y in _blocks(phase, reading):
        sums += np.array([len(x), x.sum(), y.sum(), x @ x, x @ y])
    count, sx, sy, sxx, sxy = sums
    spread = count * sxx - sx**2
    slope = (count * sxy - sx * sy) / spread if spread > 0 else 0.0
    return np.array([slope, (sy - slope * sx) / max(count, 1)])


def _blocks(phase: Any, reading: Any) -> Iterator[tuple[FloatArray, FloatArray]]:  # noqa: ANN401
    """Yield phases and readings a block at a time, without readings that are no number."""
    for start in range(0, len(phase), BLOCK):
        x, y = phase[start : start + BLOCK], reading[start : start + BLOCK]
        finite = np.isfinite(x) & np.isfinite(y)
        if finite.any():
            yield x[finite], y[finite]
