"""Which file, and which part of it, is the table of a recording."""

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from labdrive.interfaces.quantities import InputFile
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import InputError, Problem

HDF5_ENDINGS = {".h5", ".hdf5", ".nc"}
NPZ_ENDINGS = {".npz"}


class OnlyRows(SettingsBase):
    """Which rows of a CSV file count."""

    column: str = Field(description="Column to look at.")
    equals: str = Field(description="What it must hold.")


class TableSettings(SettingsBase):
    """A file, and which part of it is the table. Actuator and sensors must agree in these."""

    file: InputFile = Field(
        description="CSV with a header; HDF5 (.h5, .hdf5, .nc), a column a dataset; or .npz."
    )
    header: str = Field(
        default="", description="What the header line of a CSV file starts with; else the first."
    )
    section: int = Field(
        default=1, ge=1, description="Which table, of a log with several such headers."
    )
    only: OnlyRows | None = Field(
        default=None, description="Take only these rows of a CSV file, as of a log with remarks."
    )

    @model_validator(mode="after")
    def _fits_the_file(self) -> Self:
        chosen = self.header or self.only or self.section > 1
        if chosen and self.file.suffix.lower() in HDF5_ENDINGS | NPZ_ENDINGS:
            raise ValueError(f"header, section and only are for CSV; {self.file.name} is none")
        if self.section > 1 and not self.header:
            raise ValueError("section needs header: what each table of the log starts with")
        return self


def known_column(path: Path, known: Iterable[str], name: str, line: int = 0) -> str:
    """Return `name` if it is known; InputError with the names there are if not."""
    known = list(known)
    if name in known:
        return name
    close = difflib.get_close_matches(name, known, 1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    message = f"no column {name!r} among {', '.join(known) or 'none'}{hint}"
    raise InputError(Problem(message, file=str(path), line=line))
