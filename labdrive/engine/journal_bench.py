"""A bench that answers from a run's journal, and never goes live."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from labdrive.engine.bench import question
from labdrive.engine.plan import Prepared
from labdrive.interfaces.experiment import Setup, Tables
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import ReplayError
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.store.journal import Entry, read_journal
from labdrive.store.recordings import read_recording


class JournalBench:
    """Gives what the run was given, as long as it is asked for in the same way.

    ReplayError, naming the step, if it is not, or if the journal ends before.
    """

    def __init__(self, prepared: Prepared, folder: Path) -> None:
        self._prepared = prepared
        self._folder = folder
        entries = read_journal(folder / "journal.jsonl")
        self._intended = {e["number"]: e for e in entries if e["event"] == "recording_intended"}
        self._recorded = {e["number"]: e for e in entries if e["event"] == "recorded"}
        self._returns = {e["number"] for e in entries if e["event"] == "return_intended"}
        self._returned = {e["number"] for e in entries if e["event"] == "returned"}
        self._loads_intended = {e["number"]: e for e in entries if e["event"] == "load_intended"}
        self._loads_set = {e["number"]: e for e in entries if e["event"] == "load_set"}
        self._asked = 0
        self._loads_asked = 0

    @property
    def setup(self) -> Setup:
        """What is known of the bench without asking it."""
        return self._prepared.devices

    @property
    def run(self) -> str:
        """Name of the run."""
        return self._folder.name

    def has_next_recording(self) -> bool:
        """Return whether the next recording that is asked for was finished."""
        return self._asked + 1 in self._recorded

    def has_next_load(self) -> bool:
        """Return whether the next load that is asked for was set."""
        return self._loads_asked + 1 in self._loads_set

    def next_load(self) -> float | None:
        """Return the next load [N] that the run set, None if it set no further one."""
        if not self.has_next_load():
            return None
        return float(self._loads_intended[self._loads_asked + 1]["force"])

    def returned(self, number: int) -> bool:
        """Return whether the walk back after a recording came to its end."""
        return number in self._returned

    def differing(self, number: int, asked: Mapping[str, Any]) -> list[str]:
        """Return what of a question is another than at that step, or was never asked."""
        intended = self._intended.get(number)
        if intended is None or number not in self._recorded:
            return ["more recordings"]
        plain = json.loads(json.dumps(asked))
        return [key for key, value in plain.items() if intended[key] != value]

    def uncertain(self) -> list[Mapping[str, Any]]:
        """Return what was intended and never came to a known end."""
        return [
            *({"what": "recording", "number": n} for n in self._intended.keys() - self._recorded),
            *({"what": "return", "number": n} for n in self._returns - self._returned),
            *({"what": "load", "number": n} for n in self._loads_intended.keys() - self._loads_set),
        ]

    def first_readings(self) -> dict[str, float]:
        """Return what the run's interlocks compare readings with, by sensor."""
        return dict(self._recorded.get(1, {}).get("first_readings", {}))

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
        self._loads_asked += 1
        intended = self._loads_intended.get(self._loads_asked)
        came_to = self._loads_set.get(self._loads_asked)
        if intended is None or came_to is None:
            raise ReplayError(f"the journal ends before a load of {force:g} N was set")
        if intended["force"] != force:
            was = intended["force"]
            raise ReplayError(f"the run set a load of {was:g} N, the replay asks for {force:g} N")
        return float(came_to["force"])

    def note(self, text: str) -> None:
        """Say nothing: it was said when it happened."""

    def keep_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Keep nothing: the run's own tables stay as they are."""

    def keep_file(self, name: str, text: str) -> None:
        """Keep nothing: the run's own files stay as they are."""

    def _refuse_difference(self, asked: Mapping[str, Any], intended: Entry) -> None:
        for key, value in asked.items():
            if intended[key] != value:
                raise ReplayError(
                    f"recording {self._asked} ({intended['label']}) differs: the run had {key} "
                    f"{intended[key]}, the replay asks for {value}"
                )
