"""One run: its folder, its devices, its experiment, its end."""

import logging
import os
import platform
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from labdrive.engine.bench import LiveBench
from labdrive.engine.devices import connected
from labdrive.engine.discovery import PluginHost
from labdrive.engine.disk import refuse_full_disk
from labdrive.engine.interruption import interruptible, uninterrupted
from labdrive.engine.plan import Prepared
from labdrive.engine.supervisor import Supervisor, supervised
from labdrive.engine.versions import versions
from labdrive.interfaces.experiment import Bench
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.errors import (
    InterlockError,
    LabdriveError,
    PluginError,
    RunInterruptedError,
    StoreError,
)
from labdrive.model.events import Event, RunEnded, RunStarted
from labdrive.store.journal import Journal
from labdrive.store.lock import bench_lock, held
from labdrive.store.run_folder import LOCK, RunFolder

log = logging.getLogger(__name__)

# A bench whose run has died is being made safe for a moment.
PATIENCE_S = 5.0


@dataclass(frozen=True)
class Outcome:
    """How a run ended. `error` is None when it is done; `result` is None unless it is."""

    folder: Path
    status: str
    result: Mapping[str, Any] | None = None
    error: LabdriveError | None = None


def run(
    prepared: Prepared,
    host: PluginHost,
    runs: Path,
    listen: Callable[[Event], None],
    *,
    guarded: bool = False,
) -> Outcome:
    """Run a prepared recipe into a new folder under `runs`.

    What goes wrong once the folder exists ends up in run.json and in the outcome; StoreError only
    if the folder itself cannot be made or written. InputError if the recipe needs somebody to be
    there and nobody is. `guarded`: a process beside makes the bench safe if this one dies.
    """
    prepared.refuse_unattended()
    refuse_full_disk(prepared.plan, runs)
    with bench_held(str(prepared.loaded.bench_path), f"running {prepared.loaded.recipe_path}"):
        folder, info = _open_folder(prepared, host.plugins, runs)
        return conduct(prepared, host, folder, info, listen, lambda live: live, guarded=guarded)


def conduct(  # noqa: PLR0913 what a run is conducted with
    prepared: Prepared,
    host: PluginHost,
    folder: RunFolder,
    info: dict[str, Any],
    listen: Callable[[Event], None],
    bench: Callable[[LiveBench], Bench],
    *,
    guarded: bool = False,
) -> Outcome:
    """Run the experiment on what `bench` makes of the live bench, from first to last.

    BusyError, before anything is touched, if another process is at work in the folder. What else
    goes wrong ends up in run.json and in the outcome.
    """
    with held(folder.path / LOCK, f"the run {folder.path}"):
        folder.write_run(info)
        silence = prepared.devices.limits.silence
        beside = supervised(folder.path, info["bench"], silence)
        guard = beside if guarded else nullcontext(Supervisor())
        with _log_file(folder.path), guard as supervisor:
            outcome = _attempt(prepared, host, folder, listen, bench, supervisor)
            with uninterrupted():
                outcome = _closed(folder, info, outcome)
    host.tell("labdrive_run_ended", run=folder.path, status=outcome.status)
    listen(RunEnded(folder.path.name, outcome.status, str(outcome.error or "")))
    return outcome


def bench_held(bench: str, note: str) -> AbstractContextManager[None]:
    """Hold a bench, named by its file: one run at a time; BusyError if another process does."""
    return held(bench_lock(Path(bench)), f"the bench {bench}", f"({note})", PATIENCE_S)


def _attempt(  # noqa: PLR0913 as above
    prepared: Prepared,
    host: PluginHost,
    folder: RunFolder,
    listen: Callable[[Event], None],
    bench: Callable[[LiveBench], Bench],
    supervisor: Supervisor,
) -> Outcome:
    """Run the experiment; whatever is raised, devices are safe when this returns."""
    recipe = prepared.loaded.recipe
    try:
        with interruptible() as refuse_asked, Journal(folder.path / "journal.jsonl") as journal:
            journal.append("run_started", versions=versions(host.plugins))
            host.tell("labdrive_run_started", run=folder.path)
            listen(RunStarted(folder.path.name, recipe.title, prepared.plan.recording_count))
            with connected(prepared.devices):
                live = LiveBench(
                    prepared.devices, folder, journal, host, listen, supervisor, refuse_asked
                )
                result = dict(prepared.experiment.run(bench(live)))
            folder.write_result(result)
            journal.append("run_done")
    except LabdriveError as error:
        return Outcome(folder.path, _status(error), error=error)
    except (Exception, SystemExit) as error:  # a plugin that ends the process is at fault, too
        log.exception("the run failed in a way nobody foresaw")
        reason = PluginError(f"{type(error).__name__}: {error}; the traceback is in log.txt")
        return Outcome(folder.path, "failed", error=reason)
    return Outcome(folder.path, "done", result=result)


def _status(error: LabdriveError) -> str:
    if isinstance(error, RunInterruptedError):
        return "interrupted"
    return "stopped" if isinstance(error, InterlockError) else "failed"


def _open_folder(
    prepared: Prepared, plugins: PluginSet, runs: Path
) -> tuple[RunFolder, dict[str, Any]]:
    recipe, now = prepared.loaded.recipe, datetime.now(UTC)
    folder = RunFolder.create(runs, recipe.kind, now=now, token=secrets.token_hex(2))
    info = {
        "id": folder.path.name,
        "kind": recipe.kind,
        "title": recipe.title,
        "status": "running",
        "reason": "",
        "started": now.isoformat(),
        "ended": None,
        "recipe": str(prepared.loaded.recipe_path),
        "bench": str(prepared.loaded.bench_path),
        "actuator": prepared.devices.actuator_name,
        "seed": recipe.seed,
        **({"job": os.environ["LABDRIVE_JOB"]} if "LABDRIVE_JOB" in os.environ else {}),
        "host": socket.gethostname(),
        "platform": platform.platform(),
        "versions": versions(plugins),
    }
    folder.write_text("recipe.yaml", prepared.loaded.resolved_recipe())
    folder.write_text("bench.yaml", prepared.loaded.resolved_bench())
    return folder, info


def _closed(folder: RunFolder, info: dict[str, Any], outcome: Outcome) -> Outcome:
    """Write how the run ended; a run whose end cannot be written has failed."""
    ended = {"ended": datetime.now(UTC).isoformat(), "reason": str(outcome.error or "")}
    try:
        folder.write_run({**info, **ended, "status": outcome.status})
    except StoreError as error:
        return Outcome(folder.path, "failed", error=outcome.error or error)
    return outcome


class _RunLog(logging.FileHandler):
    """A log that must not disturb its run when it cannot be written."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 logging calls it so
        """Say nothing: what failed says so by itself."""

    def close(self) -> None:
        """Close the file, with or without its last lines."""
        with suppress(OSError):
            super().close()


@contextmanager
def _log_file(folder: Path) -> Iterator[None]:
    """Write what is logged during the run into its folder's log.txt."""
    handler = _RunLog(folder / "log.txt", encoding="utf-8", delay=True)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)
        handler.close()
