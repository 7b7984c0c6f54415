"""Numbers in the cells of CSV files."""

import math
from pathlib import Path

from labdrive.model.errors import InputError, Problem


def number(path: Path, line: int, cells: list[str], name: str, index: int) -> float:
    """Return the number in a column of a line; InputError, with its place, if there is none."""
    text = cells[index] if index < len(cells) else ""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = f"column {name!r} holds no finite number here"
        raise InputError(Problem(message, file=str(path), line=line, got=repr(text)))
    return value
