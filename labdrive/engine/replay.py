"""Recompute a run from its journal: the same questions must get the same result, bit for bit."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from labdrive.engine.bench import question
from labdrive.engine.plan import Prepared, prepare
from labdrive.interfaces.experiment import Setup, Tables
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import ReplayError
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.recipe.load import load
from labdrive.store.journal import Entry, read_journal
from labdrive.store.recordings import read_recording
from labdrive.store.run_folder import RunFolder


def replay(folder: RunFolder, plugins: PluginSet) -> Mapping[str, Any]:
    """Run the experiment of a run again on its recordings; return the result. Nothing moves.

    ReplayError, naming the step, if the experiment asks for something else than it did, if a
    recording it asks for was never made, or if the result differs. StoreError if a recording or
    the journal is damaged.
    """
    path = folder.path
    loaded = load(path / "recipe.yaml", plugins, path / "bench.yaml", ())
    prepared = prepare(loaded, plugins)
    result = dict(prepared.experiment.run(JournalBench(prepared, path)))
    _compare(folder, result)
    return result


class JournalBench:
    """A bench that answers from a run's journal, and never goes live."""

    def __init__(self, prepared: Prepared, folder: Path) -> None:
        self._prepared = prepared
        self._folder = folder
        entries = read_journal(folder / "journal.jsonl")
        self._intended = {e["number"]: e for e in entries if e["event"] == "recording_intended"}
        self._recorded = {e["number"]: e for e in entries if e["event"] == "recorded"}
        self._loads = [e for e in entries if e["event"].startswith("load_")]
        self._asked = 0

    @property
    def setup(self) -> Setup:
        """What is known of the bench without asking it."""
        return self._prepared.devices

    def record(
        self, motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
    ) -> Recording:
        """Return the recording that was made at this step, if it was asked for in the same way."""
        self._asked += 1
        asked = question(motion, table, label, return_to_start=return_to_start)
        intended = self._intended.get(self._asked)
        if intended is not None:
            self._refuse_difference(json.loads(json.dumps(asked)), intended)
        recorded = self._recorded.get(self._asked)
        if recorded is None:
            raise ReplayError(
                f"recording {self._asked} ({label}) was never finished: the journal ends before it"
            )
        return read_recording(self._folder / recorded["file"], recorded["sha256"])

    def set_load(self, force: float) -> float:
        """Return what the load came to at this step, if the same was asked for."""
        step, self._loads = self._loads[:2], self._loads[2:]
        if len(step) < 2:
            raise ReplayError(f"the journal ends before a load of {force:g} N was set")
        if step[0]["force"] != force:
            was = step[0]["force"]
            raise ReplayError(f"the run set a load of {was:g} N, the replay asks for {force:g} N")
        return float(step[1]["force"])

    def note(self, text: str) -> None:
        """Say nothing: it was said when it happened."""

    def keep_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Keep nothing: the run's own tables stay as they are."""

    def keep_file(self, name: str, text: str) -> None:
        """Keep nothing: the run's own files stay as they are."""

    @property
    def run(self) -> str:
        """Name of the run that is replayed."""
        return self._folder.name

    def _refuse_difference(self, asked: Mapping[str, Any], intended: Entry) -> None:
        for key, value in asked.items():
            if intended[key] != value:
                raise ReplayError(
                    f"recording {self._asked} ({intended['label']}) differs: the run had {key} "
                    f"{intended[key]}, the replay asks for {value}"
                )


def _compare(folder: RunFolder, result: Mapping[str, Any]) -> None:
    """Raise ReplayError at the first place where the result is not that of result.json."""
    path = folder.path / "result.json"
    if not path.is_file():
        raise ReplayError(f"{path} is missing: the run never came to a result to compare with")
    was = json.loads(path.read_text(encoding="utf-8"))
    for place, before, now in _differences("", was, json.loads(json.dumps(result))):
        raise ReplayError(f"the result differs at {place}: the run had {before}, the replay {now}")


def _differences(place: str, before: Any, now: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield (place, before, now) wherever two JSON values differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in {**before, **now}:
            inner = f"{place}.{key}".lstrip(".")
            yield from _differences(inner, before.get(key), now.get(key))
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for index, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _differences(f"{place}[{index}]", one, other)
    elif before != now:
        yield place, before, now
