"""What a run folder holds, read leniently: a run that failed has a report too."""

import csv
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import StoreError
from labdrive.report.recordings import Residual, residual

POINTS = 3000


@dataclass(frozen=True)
class RunData:
    """A run folder as the report sees it."""

    folder: Path

    @cached_property
    def info(self) -> dict[str, Any]:
        """run.json; empty if there is none."""
        return _json(self.folder / "run.json")

    @cached_property
    def result(self) -> dict[str, Any]:
        """result.json; empty if there is none."""
        return _json(self.folder / "result.json")

    def text(self, name: str) -> str:
        """Return a text file of the folder; empty if there is none."""
        path = self.folder / name
        return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""

    def table(self, name: str) -> dict[str, FloatArray]:
        """Return the columns of tables/NAME.csv; empty if there is none."""
        path = self.folder / "tables" / f"{name}.csv"
        if not path.is_file():
            return {}
        try:
            with path.open(newline="", encoding="utf-8") as file:
                header, *rows = csv.reader(file)
            columns = np.array(rows, dtype=np.float64).reshape(-1, len(header)).T
        except ValueError as error:
            raise StoreError(f"cannot read {path}: {error}; it is not a table") from error
        return dict(zip(header, columns, strict=True))

    def residual(self, file: str, sensor: str | None = None) -> Residual | None:
        """Return a recording's readings less their line; None if they are not there."""
        return residual(self.folder / file, sensor, POINTS)

    @cached_property
    def recordings(self) -> list[str]:
        """Files of the recordings, relative to the folder, in order."""
        return [f"recordings/{path.name}" for path in sorted(self.folder.glob("recordings/*.h5"))]

    @cached_property
    def tables(self) -> list[str]:
        """Files of the tables, relative to the folder, in order."""
        return [f"tables/{path.name}" for path in sorted(self.folder.glob("tables/*.csv"))]


def _json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise StoreError(f"cannot read {path}: {error}; it is damaged") from error
    return value if isinstance(value, dict) else {}
