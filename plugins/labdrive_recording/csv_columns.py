"""Columns of a CSV file, or of a log that holds such tables among other lines."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import TextIO

import numpy as np

from labdrive.interfaces.csv_cells import number
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive_recording.table_settings import TableSettings, known_column


@dataclass(frozen=True)
class _Table:
    """A header, the line it stands in, and the lines below it up to the next such header."""

    path: Path
    line: int
    names: list[str]
    lines: Iterator[str]

    def index(self, name: str) -> int:
        return self.names.index(known_column(self.path, self.names, name, self.line))

    def rows(self, settings: TableSettings) -> Iterator[tuple[int, list[str]]]:
        """Yield the rows that count, with the numbers of their lines."""
        rows = csv.reader(self.lines, skipinitialspace=True)
        index = 0 if settings.only is None else self.index(settings.only.column)
        for cells in rows:
            if settings.only is None:
                counts = bool(cells)
            else:
                counts = len(cells) > index and cells[index].strip() == settings.only.equals
            if counts:
                yield self.line + rows.line_num, cells


def read_csv(settings: TableSettings, names: list[str]) -> dict[str, FloatArray]:
    """Return the named columns; InputError with the line of what is missing or no number."""
    with settings.file.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        table = _table(settings, file)
        indices = [(name, table.index(name)) for name in names]
        values: dict[str, list[float]] = {name: [] for name in names}
        try:
            for line, cells in table.rows(settings):
                for name, index in indices:
                    values[name].append(number(settings.file, line, cells, name, index))
        except csv.Error as error:
            raise InputError(Problem(f"no CSV: {error}", file=str(settings.file))) from error
    return {name: np.array(column, dtype=np.float64) for name, column in values.items()}


def _table(settings: TableSettings, file: TextIO) -> _Table:
    """Read up to the header line that `settings` asks for."""
    seen = 0
    for line_number, line in enumerate(file, start=1):
        if line.strip() and line.startswith(settings.header):
            seen += 1
        if seen == settings.section:
            names = [name.strip() for name in next(csv.reader([line], skipinitialspace=True))]
            return _Table(settings.file, line_number, names, _up_to_next_header(settings, file))
    start = f" that starts with {settings.header!r}" if settings.header else ""
    count = f"; section {settings.section} of {seen} was asked for" if seen else ""
    raise InputError(Problem(f"no header line{start}{count}", file=str(settings.file)))


def _up_to_next_header(settings: TableSettings, file: TextIO) -> Iterator[str]:
    if not settings.header:
        return file
    return takewhile(lambda line: not line.startswith(settings.header), file)
