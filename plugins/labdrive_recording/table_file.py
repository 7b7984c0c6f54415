"""Columns of numbers in a file: CSV with a header, HDF5 or npz, told apart by the ending."""

import csv
import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from pydantic import Field

from labdrive.interfaces.quantities import InputFile
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem

HDF5_ENDINGS = {".h5", ".hdf5", ".nc"}


class OnlyRows(SettingsBase):
    """Which rows of a CSV file count."""

    column: str
    equals: str


class TableSettings(SettingsBase):
    """A file, and which part of it is the table. Actuator and sensors must agree in these."""

    file: InputFile = Field(
        description="CSV with a header; HDF5 (.h5, .hdf5, .nc), a column a dataset; or .npz."
    )
    header: str = Field(
        default="", description="What the header line of a CSV file starts with; else the first."
    )
    only: OnlyRows | None = Field(
        default=None, description="Take only these rows of a CSV file, as of a log with remarks."
    )


def read_columns(settings: TableSettings, names: Iterable[str]) -> dict[str, FloatArray]:
    """Return the named columns, each of shape (rows,).

    InputError, naming the file and where it has lines the line, if a column is missing, holds
    anything but finite numbers, or is as long as the others.
    """
    path, ending = settings.file, settings.file.suffix.lower()
    if ending in HDF5_ENDINGS:
        columns = _from_hdf5(path, list(names))
    elif ending == ".npz":
        columns = _from_npz(path, list(names))
    else:
        columns = _from_csv(settings, list(names))
    _check(path, columns)
    return columns


def _from_csv(settings: TableSettings, names: list[str]) -> dict[str, FloatArray]:
    path = settings.file
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        lines = csv.reader(file, skipinitialspace=True)
        header = _header(settings, lines)
        wanted = {name: _index(path, header, name) for name in names}
        rows: dict[str, list[float]] = {name: [] for name in names}
        for cells in _rows_that_count(settings, header, lines):
            for name, index in wanted.items():
                rows[name].append(_number(path, lines.line_num, name, cells, index))
    return {name: np.array(values) for name, values in rows.items()}


def _header(settings: TableSettings, lines: Iterator[list[str]]) -> list[str]:
    """Read up to the header line and return its names."""
    for cells in lines:
        if ",".join(cells).startswith(settings.header.rstrip(",")):
            return [cell.strip() for cell in cells]
    start = f" that starts with {settings.header!r}" if settings.header else ""
    raise InputError(Problem(f"no header line{start}", file=str(settings.file)))


def _rows_that_count(
    settings: TableSettings, header: list[str], lines: Iterator[list[str]]
) -> Iterator[list[str]]:
    if settings.only is None:
        yield from (cells for cells in lines if cells)
        return
    index = _index(settings.file, header, settings.only.column)
    for cells in lines:
        if len(cells) > index and cells[index].strip() == settings.only.equals:
            yield cells


def _number(path: Path, line: int, name: str, cells: list[str], index: int) -> float:
    text = cells[index].strip() if index < len(cells) else ""
    try:
        return float(text)
    except ValueError:
        message = f"column {name!r} holds no number here"
        problem = Problem(message, file=str(path), line=line, got=repr(text))
        raise InputError(problem) from None


def _from_hdf5(path: Path, names: list[str]) -> dict[str, FloatArray]:
    import h5py  # noqa: PLC0415 80 ms, for such files only

    try:
        with h5py.File(path, "r") as file:
            known: list[str] = []
            file.visititems(lambda n, item: known.append(n) if hasattr(item, "shape") else None)
            return {
                name: _values(path, name, file[_known(path, known, name)][()]) for name in names
            }
    except OSError as error:
        raise InputError(Problem(f"cannot be read as HDF5: {error}", file=str(path))) from error


def _from_npz(path: Path, names: list[str]) -> dict[str, FloatArray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            known = list(file.files)
            return {name: _values(path, name, file[_known(path, known, name)]) for name in names}
    except (OSError, ValueError) as error:
        raise InputError(Problem(f"cannot be read as npz: {error}", file=str(path))) from error


def _values(path: Path, name: str, values: object) -> FloatArray:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        message = f"{name!r} is no column of numbers: shape {array.shape}, {array.dtype}"
        raise InputError(Problem(message, file=str(path)))
    return array.astype(np.float64)


def _index(path: Path, header: list[str], name: str) -> int:
    return header.index(_known(path, header, name))


def _known(path: Path, known: list[str], name: str) -> str:
    """Return `name` if it is a column; InputError with the names there are if not."""
    if name in known:
        return name
    close = difflib.get_close_matches(name, known, 1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    message = f"no column {name!r} among {', '.join(known) or 'none'}{hint}"
    raise InputError(Problem(message, file=str(path)))


def _check(path: Path, columns: dict[str, FloatArray]) -> None:
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(Problem(f"columns differ in length: {lengths}", file=str(path)))
    for name, values in columns.items():
        if len(values) < 2:
            message = f"column {name!r} holds {len(values)} rows; two at least make a recording"
            raise InputError(Problem(message, file=str(path)))
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            message = f"column {name!r} holds {values[row]} in row {row + 1} of the table"
            raise InputError(Problem(message, file=str(path)))
