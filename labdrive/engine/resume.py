"""Go on with a run that was cut short: the same questions, answered from the journal, then live."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from labdrive.engine.bench import LiveBench
from labdrive.engine.discovery import PluginHost
from labdrive.engine.journal_bench import JournalBench
from labdrive.engine.plan import Prepared, prepare
from labdrive.engine.run import Outcome, bench_held, conduct
from labdrive.engine.versions import changed_versions
from labdrive.interfaces.experiment import Bench, Setup, Tables
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError
from labdrive.model.events import Event, Note
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.recipe.load import load
from labdrive.store.run_folder import RunFolder


def resume(
    path: Path,
    host: PluginHost,
    listen: Callable[[Event], None],
    ask: Callable[[str], str] | None = None,
    *,
    guarded: bool = False,
) -> Outcome:
    """Go on with the run in a folder, to its end; return how that came.

    InputError if the run is done, BusyError if it is still running, ReplayError if the experiment
    asks for something else than it did, StoreError for a damaged journal or recording. None of
    them moves anything.
    """
    folder = RunFolder.open(path)
    info = folder.read_run()
    if info.get("status") == "done":
        raise InputError(f"{path} is done: there is nothing to go on with")
    prepared = _prepared(folder, host, ask)
    for change in changed_versions(info, host.plugins):
        listen(Note(f"since the run began: {change}"))
    resumed = [*info.get("resumed", []), datetime.now(UTC).isoformat()]
    info = {**info, "status": "running", "reason": "", "ended": None, "resumed": resumed}

    def bench(live: LiveBench) -> Bench:
        return ResumedBench(JournalBench(prepared, path), live)

    with bench_held(info["bench"], f"resuming {path.name}"):
        return conduct(prepared, host, folder, info, listen, bench, guarded=guarded)


def _prepared(folder: RunFolder, host: PluginHost, ask: Callable[[str], str] | None) -> Prepared:
    path = folder.path
    loaded = load(path / "recipe.yaml", host.plugins, path / "bench.yaml", ())
    prepared = prepare(loaded, host.plugins, ask)
    prepared.refuse_unattended()
    return prepared


class ResumedBench:
    """Answers from the journal until it is used up; from there on the live bench does."""

    def __init__(self, past: JournalBench, live: LiveBench) -> None:
        self._past = past
        self._live = live
        self._is_live = False

    @property
    def setup(self) -> Setup:
        """What is known of the bench without asking it."""
        return self._live.setup

    @property
    def run(self) -> str:
        """Name of the run."""
        return self._live.run

    def note(self, text: str) -> None:
        """Say what was not said before."""
        if self._is_live:
            self._live.note(text)

    def keep_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Write the table, again if it was there: the kill may have come in between."""
        self._live.keep_table(name, columns)

    def keep_file(self, name: str, text: str) -> None:
        """Write the file, again if it was there."""
        self._live.keep_file(name, text)

    def record(
        self, motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
    ) -> Recording:
        """Return the recording that was made at this step, or make it."""
        if self._is_live or not self._past.has_next_recording():
            self._go_live()
            return self._live.record(motion, table, label, return_to_start=return_to_start)
        recording = self._past.record(motion, table, label, return_to_start=return_to_start)
        self._live.relive(recording.number, motion, table)
        if return_to_start and self._past.returned(recording.number):
            self._live.relive(recording.number, motion.returning(), table, again=True)
        elif return_to_start:
            self._go_live()
            self._live.return_again(recording.number, motion, table, label)
        return recording

    def set_load(self, force: float) -> float:
        """Return what the load came to at this step, or set it."""
        if self._is_live or not self._past.has_next_load():
            self._go_live()
            return self._live.set_load(force)
        came_to = self._past.set_load(force)
        self._live.relive_load(force)
        return came_to

    def _go_live(self) -> None:
        """Say what is uncertain; put the load back that was on when the run was cut short."""
        if self._is_live:
            return
        self._is_live = True
        self._live.go_on(self._past.uncertain(), self._past.first_readings())
