"""What other settings would have made of a run's recordings, as far as those answer; nothing moves.

The experiment runs with changed settings on the recordings there are. Where it asks for something
that was not recorded it has come to a proposal of its own: that is the answer.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from labdrive.engine.bench import question
from labdrive.engine.journal_bench import JournalBench
from labdrive.engine.plan import Prepared, prepare
from labdrive.interfaces.experiment import Tables
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.model.waveform import WaveformTable
from labdrive.recipe.load import load
from labdrive.store.run_folder import RunFolder


@dataclass(frozen=True)
class Difference:
    """How far a proposed output is off the one that was played: largest and rms [`unit`]."""

    channel: str
    unit: str
    largest: float
    rms: float


@dataclass(frozen=True)
class OtherLoad:
    """A load [N] that was asked for, and what the run set there; None if it set no further one."""

    asked: float
    was: float | None


@dataclass(frozen=True, eq=False)
class WhatIf:
    """How far the recordings answered.

    `result` is there if they answered all; else `number` and `label` name the recording that was
    asked for, `asks_for` what of it is another, and `differences` how its table differs. Where it
    departs by a `load`, that is set before the recording of this number, which has no label yet.
    """

    result: Mapping[str, Any] | None = None
    number: int = 0
    label: str = ""
    asks_for: Sequence[str] = ()
    load: OtherLoad | None = None
    differences: Sequence[Difference] = ()


def what_if(
    folder: RunFolder,
    plugins: PluginSet,
    overrides: Sequence[str],
    say: Callable[[str], None],
) -> WhatIf:
    """Run the experiment of a run with other settings on its recordings.

    `say` is given what the experiment notes. InputError for overrides that make no recipe.
    """
    played = _Playing(_prepared(folder, plugins, ()), folder, lambda _: None)
    _until_it_departs(played)
    other = _Playing(_prepared(folder, plugins, overrides), folder, say)
    result = _until_it_departs(other)
    if isinstance(result, Mapping):
        return WhatIf(result=result)
    before, now = (bench.tables.get(result.number, {}) for bench in (played, other))
    return WhatIf(
        number=result.number,
        label=result.label,
        asks_for=result.asks_for,
        load=result.load,
        differences=_differences(before, now),
    )


class _DepartedError(Exception):
    """The experiment asks for something else than was recorded."""

    def __init__(
        self, number: int, label: str, asks_for: Sequence[str], load: OtherLoad | None = None
    ) -> None:
        self.number, self.label, self.asks_for, self.load = number, label, asks_for, load
        super().__init__(label)


class _Playing(JournalBench):
    """A journal bench that keeps the tables it is asked to play, and says what is noted."""

    def __init__(self, prepared: Prepared, folder: RunFolder, say: Callable[[str], None]) -> None:
        super().__init__(prepared, folder.path)
        self.prepared = prepared
        self.tables: dict[int, dict[str, WaveformTable]] = {}
        self._say = say

    def record(
        self, motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
    ) -> Recording:
        """Return the recording of this step; _DepartedError if it was made of something else."""
        number = len(self.tables) + 1
        self.tables[number] = self.prepared.devices.played(table)
        asked = question(motion, table, label, return_to_start=return_to_start)
        others = self.differing(number, asked)
        if others:
            named = [name.removesuffix("_sha256") for name in others]
            raise _DepartedError(number, label, named)
        return super().record(motion, table, label, return_to_start=return_to_start)

    def set_load(self, force: float) -> float:
        """Return what the load came to at this step; _DepartedError if it was another."""
        was = self.next_load()
        if was != force:
            raise _DepartedError(len(self.tables) + 1, "", ("load",), OtherLoad(force, was))
        return super().set_load(force)

    def note(self, text: str) -> None:
        """Say it: it is what the other settings find."""
        self._say(text)


def _prepared(folder: RunFolder, plugins: PluginSet, overrides: Sequence[str]) -> Prepared:
    path = folder.path
    return prepare(load(path / "recipe.yaml", plugins, path / "bench.yaml", overrides), plugins)


def _until_it_departs(bench: _Playing) -> Mapping[str, Any] | _DepartedError:
    try:
        return dict(bench.prepared.experiment.run(bench))
    except _DepartedError as departed:
        return departed


def _differences(
    before: Mapping[str, WaveformTable], now: Mapping[str, WaveformTable]
) -> list[Difference]:
    """Return how the outputs differ, where both have a channel of that name."""
    found = []
    for actuator, table in now.items():
        old = _samples(before[actuator]) if actuator in before else {}
        for channel in table.channels:
            if len(old.get(channel.name, ())) == table.length:
                off = channel.samples - old[channel.name]
                largest, rms = float(np.abs(off).max()), float(np.sqrt(np.mean(off**2)))
                found.append(Difference(channel.name, channel.unit, largest, rms))
    return found


def _samples(table: WaveformTable) -> dict[str, FloatArray]:
    return {channel.name: channel.samples for channel in table.channels}
