"""Recipes with several waveforms."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from labdrive.interfaces.experiment import Setup
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError
from labdrive.model.waveform import WaveformTable


def nominal_tables(setup: Setup, waveforms: Sequence[Waveform]) -> list[WaveformTable]:
    """Return the table of each of a recipe's `waveforms`; InputError at the one that is wrong."""
    tables = []
    for i, waveform in enumerate(waveforms):
        with in_place_of("waveform", f"waveforms.{i}"):
            tables.append(setup.nominal_table(waveform))
    return tables


@contextmanager
def in_place_of(field: str, place: str) -> Iterator[None]:
    """Let problems with `field` point at `place`, where this recipe has it."""
    try:
        yield
    except InputError as error:
        moved = (
            replace(p, field=place + p.field.removeprefix(field))
            if p.field.startswith(field)
            else p
            for p in error.problems
        )
        raise InputError(*moved) from error
