"""What a recording has read so far, on disk while it lasts: at most a second of it can be lost.

A line of JSON that names the columns, then rows of little-endian doubles. Whoever reads a spool
that was left behind by a kill gets every whole row: it is evidence, never a recording.
"""

import json
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import StoreError
from labdrive.store.durable import cannot_write

SYNC_EVERY_S = 1.0
SUFFIX = ".spool"


class Spool:
    """A file that grows with a recording; each chunk is flushed, each second synced.

    Leaving the block without an error removes the file: the recording itself is on the disk then.
    After an error it stays, if anything was read.
    StoreError if it cannot be written.
    """

    def __init__(self, path: Path, label: str) -> None:
        self._path = path
        self._label = label
        self._synced = time.monotonic()
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise cannot_write(path, error) from error
        self._columns: Sequence[str] = ()

    def add(self, columns: Mapping[str, FloatArray]) -> None:
        """Add a chunk: the same columns each time, all of one length."""
        try:
            if not self._columns:
                self._columns = list(columns)
                header = {"label": self._label, "columns": self._columns}
                self._file.write(json.dumps(header).encode() + b"\n")
            rows = np.stack([columns[name] for name in self._columns], axis=1)
            self._file.write(rows.astype("<f8").tobytes())
            self._file.flush()
            if time.monotonic() - self._synced >= SYNC_EVERY_S:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            raise cannot_write(self._path, error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with suppress(OSError):  # what could not be written was told when it was tried
            self._file.close()
        if kind is None or not self._columns:
            self._path.unlink(missing_ok=True)


def read_spool(path: Path) -> dict[str, FloatArray]:
    """Return the columns of a spool, up to its last whole row; StoreError if it is none."""
    try:
        header, _, data = path.read_bytes().partition(b"\n")
        columns = json.loads(header)["columns"]
        whole = len(data) // (8 * len(columns)) * 8 * len(columns)
        rows = np.frombuffer(data[:whole], "<f8").reshape(-1, len(columns))
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise StoreError(f"cannot read the spool {path}: {error}") from error
    return {name: np.asarray(rows[:, i], np.float64) for i, name in enumerate(columns)}


def set_aside(folder: Path, number: int) -> str | None:
    """Give what a kill left of a recording a name of its own, out of the way; return it."""
    path = folder / f"{number:04d}{SUFFIX}"
    if not path.exists():
        return None
    taken = len(list(folder.glob(f"{number:04d}.part-*{SUFFIX}")))
    aside = folder / f"{number:04d}.part-{taken + 1}{SUFFIX}"
    path.rename(aside)
    return f"{folder.name}/{aside.name}"
