"""A run folder: the truth about one run, readable by anybody without labdrive."""

import csv
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, StoreError
from labdrive.store.durable import make_folder, write_json, write_text
from labdrive.store.lock import is_held

LOCK = ".lock"
"""A file that a run holds locked while it is at work."""
ALIVE = ".alive"
"""A file whose time of change says when a run last showed a sign of life."""


@dataclass(frozen=True)
class RunFolder:
    """The folder of one run; everything in it is written whole or not at all."""

    path: Path

    @classmethod
    def create(cls, root: Path, kind: str, *, now: datetime, token: str) -> Self:
        """Make `root`/20261120T194512Z-KIND-TOKEN; `now` in UTC. StoreError if it cannot be."""
        path = root / f"{now:%Y%m%dT%H%M%SZ}-{kind}-{token}"
        for folder in (path, path / "recordings", path / "tables"):
            make_folder(folder)
        return cls(path)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Return the folder at `path`; InputError if that is no run folder."""
        if not (path / "run.json").is_file():
            raise InputError(f"{path} is not a run folder: it holds no run.json")
        return cls(path)

    def show_life(self) -> None:
        """Note that the run is at work; not on the disk, as it is for those who watch now."""
        with suppress(OSError):
            (self.path / ALIVE).touch()

    def write_run(self, info: Mapping[str, Any]) -> None:
        """Write run.json."""
        write_json(self.path / "run.json", dict(info))

    def read_run(self) -> dict[str, Any]:
        """Read run.json; StoreError if it is damaged."""
        return _read_object(self.path / "run.json")

    def write_result(self, result: Mapping[str, Any]) -> None:
        """Write result.json."""
        write_json(self.path / "result.json", dict(result))

    def write_text(self, name: str, text: str) -> None:
        """Write a text file of that name."""
        write_text(self.path / name, text)

    def write_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Write tables/NAME.csv: a header, then rows with every digit of each number."""
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
        write_text(self.path / "tables" / f"{name}.csv", "\n".join(lines) + "\n")

    def read_table(self, name: str) -> dict[str, FloatArray]:
        """Read tables/NAME.csv: each column's numbers by its name; StoreError if it is damaged."""
        path = self.path / "tables" / f"{name}.csv"
        try:
            with path.open(newline="", encoding="utf-8") as file:
                header, *rows = csv.reader(file)
            numbers = np.array([[float(cell) for cell in row] for row in rows])
            columns = numbers.reshape(len(rows), len(header)).T
        except (OSError, ValueError) as error:
            raise StoreError(f"cannot read {path}: {error}") from error
        return dict(zip(header, columns, strict=True))


def list_runs(root: Path) -> list[dict[str, Any]]:
    """Return run.json of every run under `root`, newest first; other folders are passed over.

    A run whose run.json is damaged is there as well, with status `unreadable`.
    """
    folders = sorted((path.parent for path in root.glob("*/run.json")), reverse=True)
    return [info for info in map(read_info, folders) if info is not None]


def read_info(folder: Path) -> dict[str, Any] | None:
    """Return run.json with the folder's name as `id`; None if that is no run's."""
    try:
        info = _read_object(folder / "run.json")
    except StoreError as error:
        info = {"status": "unreadable", "title": str(error)}
    return {**info, "id": folder.name} if "status" in info else None


def present_status(folder: Path, told: str) -> str:
    """Return a run's status; of one that says `running` but has nobody at work, `cut short`."""
    return "cut short" if told == "running" and is_held(folder / LOCK) is False else told


def _read_object(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    if not isinstance(value, dict):
        raise StoreError(f"cannot read {path}: it holds no JSON object")
    return value
