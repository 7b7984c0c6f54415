"""A process beside each run, on its own timer: what a run that died or froze cannot do, it does.

The run tells it over a pipe when something moves and when all is over; each chunk of readings
leaves a sign of life in the run folder. If the pipe closes without a word, the run has died. If
something moves and there is no sign of life for `limits.silence`, it has frozen, and is ended.
Either way the bench is made safe, by connecting to it anew. Not on Windows, whose pipes cannot be
waited for in this way.
"""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from labdrive.model.errors import LabdriveError
from labdrive.store.lock import bench_lock, held
from labdrive.store.run_folder import ALIVE, RunFolder

LOOK_S = 0.2
MOVING, STILL, OVER = "moving", "still", "over"
LOCK_PATIENCE_S = 30.0


@dataclass(frozen=True)
class Supervisor:
    """The run's end of the pipe."""

    pipe: IO[str] | None = None

    def tell(self, word: str) -> None:
        """Say that something moves, that it is still, or that all is over."""
        if self.pipe is not None:
            with suppress(OSError):  # a supervisor that is gone must not end the run
                self.pipe.write(word + "\n")
                self.pipe.flush()


@contextmanager
def supervised(folder: Path, bench: str, silence_s: float) -> Iterator[Supervisor]:
    """Have a process beside the block that makes the bench safe if the block cannot."""
    if os.name == "nt":
        yield Supervisor()
        return
    command = [sys.executable, "-m", "labdrive", "supervise", str(folder), bench, str(silence_s)]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(  # noqa: S603 our own command
        command,
        stdin=subprocess.PIPE,
        stdout=quiet,
        stderr=quiet,
        text=True,
        start_new_session=True,
    )
    supervisor = Supervisor(process.stdin)
    try:
        yield supervisor
    finally:
        supervisor.tell(OVER)


def supervise(folder: RunFolder, bench: Path, silence_s: float) -> None:
    """Watch over the run that is this process's parent, until it is over; then make it safe."""
    reason = _watch(os.getppid(), folder.path / ALIVE, silence_s)
    if reason:
        _make_safe(folder, bench, reason)


def _watch(run: int, alive: Path, silence_s: float) -> str:
    """Return what became of the run: "" if it ended as it should."""
    moving = False
    since = time.time()
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], LOOK_S)
        if ready:
            word = sys.stdin.readline().strip()
            if word == OVER:
                return ""
            if not word:
                return "the run's process died"
            moving, since = word == MOVING, time.time()
        last = max(since, alive.stat().st_mtime if alive.exists() else 0.0)
        if moving and time.time() - last > silence_s:
            with suppress(ProcessLookupError):
                os.kill(run, signal.SIGKILL)
            return f"no sign of life for {silence_s:g} s while moving; the run's process was ended"


def _make_safe(folder: RunFolder, bench: Path, reason: str) -> None:
    """Connect to the bench, make every actuator safe, and write down how that went."""
    # Imported late: beside every run there is a process like this, and most have nothing to do.
    from labdrive.engine.devices import build, connected
    from labdrive.engine.discovery import discover
    from labdrive.recipe.load import load_bench

    try:
        with held(bench_lock(bench), f"the bench {bench}", "(being made safe)", LOCK_PATIENCE_S):
            plugins = discover().plugins
            settings = load_bench(folder.path / "bench.yaml", plugins)
            devices = build(settings, plugins, next(iter(settings.actuators)), 0, bench.parent)
            with connected(devices):
                pass
            _note(folder, f"{reason}; made safe: {', '.join(devices.actuators)}")
    except LabdriveError as error:
        _note(folder, f"{reason}; it could not be made safe: {error}")


def _note(folder: RunFolder, text: str) -> None:
    """Write into run.json and log.txt why the run ended."""
    now = datetime.now(UTC).isoformat()
    with suppress(OSError), (folder.path / "log.txt").open("a", encoding="utf-8") as file:
        file.write(f"{now} supervisor: {text}\n")
    info = folder.read_run()
    if info.get("status") == "running":
        folder.write_run({**info, "status": "failed", "reason": text, "ended": now})
