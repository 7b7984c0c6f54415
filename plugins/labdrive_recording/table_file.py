"""Columns of numbers in a file: CSV with a header, HDF5 or npz, told apart by the ending."""

import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive_recording.csv_columns import read_csv
from labdrive_recording.table_settings import (
    HDF5_ENDINGS,
    NPZ_ENDINGS,
    TableSettings,
    known_column,
)

CHUNK_ROWS = 65536
"""Rows are played so many at a time; a shorter chunk is the last one."""

_UNREADABLE = (OSError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


def read_columns(settings: TableSettings, names: Iterable[str]) -> dict[str, FloatArray]:
    """Return the named columns, each of shape (rows,).

    InputError, naming the file and where it has lines the line, if the file cannot be read, or a
    column is missing, holds anything but finite numbers, or is not as long as the others.
    """
    path, wanted = settings.file, list(dict.fromkeys(names))
    try:
        columns = _reader(path.suffix.lower())(settings, wanted)
    except _UNREADABLE as error:
        raise InputError(Problem(f"cannot be read: {error}", file=str(path))) from error
    _check(path, columns)
    return columns


def _reader(ending: str) -> Callable[[TableSettings, list[str]], dict[str, FloatArray]]:
    if ending in HDF5_ENDINGS:
        return _read_hdf5
    return _read_npz if ending in NPZ_ENDINGS else read_csv


def _read_hdf5(settings: TableSettings, names: list[str]) -> dict[str, FloatArray]:
    import h5py

    path, known = settings.file, []
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: known.append(name) if hasattr(item, "shape") else None)
        datasets = {name: file[known_column(path, known, name.lstrip("/"))] for name in names}
        return {name: _values(path, name, dataset) for name, dataset in datasets.items()}


def _read_npz(settings: TableSettings, names: list[str]) -> dict[str, FloatArray]:
    path = settings.file
    if not zipfile.is_zipfile(path):
        raise InputError(Problem("is no npz archive", file=str(path)))
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[known_column(path, file.files, name)] for name in names}
    return {name: _values(path, name, array) for name, array in arrays.items()}


def _values(path: Path, name: str, values: object) -> FloatArray:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        message = f"{name!r} is no column of numbers: shape {array.shape}, {array.dtype}"
        raise InputError(Problem(message, file=str(path)))
    return array.astype(np.float64)


def _check(path: Path, columns: dict[str, FloatArray]) -> None:
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(Problem(f"columns differ in length: {told}", file=str(path)))
    for name, values in columns.items():
        if len(values) < 2:
            message = f"column {name!r} has {len(values)} rows; two at least make a recording"
            raise InputError(Problem(message, file=str(path)))
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            message = f"column {name!r} holds {values[row]} in row {row + 1} of the table"
            raise InputError(Problem(message, file=str(path)))
