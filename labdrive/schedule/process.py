"""A job in a process of its own: started, watched for signs of life, stopped, made safe."""

import asyncio
import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Job
from labdrive.schedule.service import Ended
from labdrive.store.lock import holder, is_held
from labdrive.store.run_folder import ALIVE, LOCK

LOOK_S = 0.5
# To end in good order after SIGTERM: halt, make safe, close the run folder.
GRACE_S = 15.0
SAFE_S = 60.0
JOB = "LABDRIVE_JOB"
BUSY = "is in use by"
NEWEST = 200
LOGS_KEPT = 1000


class Process(Protocol):
    """What is watched: a child, or a run that has outlived the service that began it."""

    @property
    def returncode(self) -> int | None:
        """Its exit code; None while it lives, or if that is not known."""

    async def wait(self) -> object:
        """Wait until it has ended."""

    def send_signal(self, number: int) -> None:
        """Send a signal; ProcessLookupError if it has ended."""


class _Outlived:
    """A run that is no child of ours, known by the lock it holds on its folder."""

    returncode = None

    def __init__(self, folder: Path) -> None:
        self._lock = folder / LOCK

    async def wait(self) -> None:
        while is_held(self._lock):  # noqa: ASYNC110 a lock of the kernel wakes nobody
            await asyncio.sleep(LOOK_S)

    def send_signal(self, number: int) -> None:
        process = holder(self._lock) if is_held(self._lock) else None
        if process is None:
            raise ProcessLookupError
        os.kill(process, number)


class ProcessRunner:
    """Runs `labdrive run` or `labdrive resume` for each job; what it prints is kept in `logs`.

    A run that has outlived its service is watched to its end instead.
    """

    def __init__(self, runs: Path, logs: Path) -> None:
        self._runs = runs
        self._logs = logs

    async def run(self, job: Job, schedule: Schedule) -> Ended:
        """Run a job; see `Runner`."""
        log = self._new_log(job)
        begun = self._folder(job) if job.attempts > 1 else None
        process: Process
        if begun is not None and is_held(begun / LOCK):
            process = _Outlived(begun)
        elif begun is not None and _status(begun) == "done":
            return Ended("done", run=str(begun))
        else:
            command = _command(begun if schedule.resume else None, schedule, self._runs)
            process = await _started(command, job, log)
        try:
            hung = await self._watched(process, job, schedule, log)
        except asyncio.CancelledError:
            await _stop(process)
            raise
        folder = self._folder(job)
        if hung:
            await _stop(process)
            safe = await _make_safe(schedule, log)
            reason = f"no sign of life for {schedule.hang_after:g} s; {safe}"
            return Ended("hung", reason, None if folder is None else str(folder))
        return _ended(process.returncode, folder, log)

    def _new_log(self, job: Job) -> Path:
        """Return an empty file for what this attempt prints; of those before, the newest stay."""
        self._logs.mkdir(parents=True, exist_ok=True)
        logs = sorted(self._logs.glob("job-*.log"), key=lambda path: path.stat().st_mtime)
        for old in logs[: -(LOGS_KEPT - 1)]:
            old.unlink(missing_ok=True)
        # One for each attempt: the one before may live on, and print what is not ours.
        log = self._logs / f"job-{job.id}-{job.attempts}.log"
        log.write_bytes(b"")
        return log

    async def _watched(self, process: Process, job: Job, schedule: Schedule, log: Path) -> bool:
        """Wait for the process to end; return True if it shows no sign of life any more."""
        # A change of these times is a sign of life, whatever the clock of the day is set to.
        seen: list[float] = []
        lived = time.monotonic()
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), LOOK_S)
                return False
            folder = self._folder(job)
            signs = [log] if folder is None else [log, folder / ALIVE, folder / "journal.jsonl"]
            changed = [path.stat().st_mtime for path in signs if path.exists()]
            if changed != seen:
                seen, lived = changed, time.monotonic()
            if time.monotonic() - lived > schedule.hang_after:
                return True

    def _folder(self, job: Job) -> Path | None:
        """Return the newest run folder of a job, which its run.json names."""
        for path in sorted(self._runs.glob("*/run.json"), reverse=True)[:NEWEST]:
            if _info(path.parent).get("job") == _key(job):
                return path.parent
        return Path(job.run) if job.run is not None and Path(job.run).is_dir() else None


def _key(job: Job) -> str:
    """Return what no other job has, of this queue or of one that was there before."""
    return f"{job.schedule} {job.due}"


async def _started(command: list[str], job: Job, log: Path) -> asyncio.subprocess.Process:
    with log.open("ab") as output:
        return await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            env={**os.environ, JOB: _key(job)},
            # Ctrl-C at a terminal is for the service, which then stops its runs itself.
            start_new_session=True,
        )


def _command(begun: Path | None, schedule: Schedule, runs: Path) -> list[str]:
    labdrive = [sys.executable, "-m", "labdrive"]
    if begun is not None:
        return [*labdrive, "resume", str(begun)]
    bench = ["--bench", str(schedule.bench)] if schedule.bench else []
    return [*labdrive, "run", str(schedule.recipe), *bench, "--runs", str(runs)]


def _ended(code: int | None, folder: Path | None, log: Path) -> Ended:
    """Return how an attempt ended: its run.json says that, or else the last it printed."""
    info = {} if folder is None else _info(folder)
    run = None if folder is None else str(folder)
    if code == 0 or info.get("status") == "done":
        return Ended("done", run=run)
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    last = lines[-1] if lines else info.get("reason") or "it ended without a word"
    if info.get("status") == "interrupted":
        return Ended("stopped", last, run)
    return Ended("busy" if BUSY in last else "failed", last, run)


def _info(folder: Path) -> dict[str, Any]:
    try:
        info = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return info if isinstance(info, dict) else {}


def _status(folder: Path) -> str:
    return str(_info(folder).get("status", ""))


async def _stop(process: Process) -> None:
    """Ask the process to end in good order; end it if it does not."""
    for number in (signal.SIGTERM, signal.SIGKILL if os.name != "nt" else signal.SIGTERM):
        with suppress(ProcessLookupError):
            process.send_signal(number)
        with suppress(TimeoutError):
            await asyncio.wait_for(process.wait(), GRACE_S)
            return


async def _make_safe(schedule: Schedule, log: Path) -> str:
    """Make the bench safe by a fresh process; return in words how that went."""
    with log.open("ab") as output:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "labdrive",
            "safe",
            str(schedule.bench),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=output,
            stderr=output,
        )
    try:
        code = await asyncio.wait_for(process.wait(), SAFE_S)
    except TimeoutError:
        process.kill()
        return "its bench could not be made safe in time"
    return "its bench was made safe" if code == 0 else "its bench could not be made safe"
