"""A job in a process of its own: started, watched for signs of life, stopped, made safe."""

import asyncio
import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, Protocol

from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Job
from labdrive.schedule.service import Ended
from labdrive.store.lock import holder, is_held, tells_busy
from labdrive.store.run_folder import ALIVE, LOCK

LOOK_S = 0.5
# To end in good order after SIGTERM: halt, make safe, close the run folder.
GRACE_S = 15.0
SAFE_S = 60.0
JOB = "LABDRIVE_JOB"
NEWEST = 200
LOGS_KEPT = 1000

How = Literal["failed", "interlock", "stopped"]
# Of a child. SIGTERM kills a run that has not begun to listen for it.
BY_CODE: dict[int, How] = {3: "interlock", 130: "stopped", -signal.SIGTERM: "stopped"}
# Of a run that is no child of ours, by its run.json.
BY_STATUS: dict[str, How] = {"stopped": "interlock", "interrupted": "stopped"}


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
        ended = _ended(process.returncode, folder, log)
        if ended.how == "busy":
            # There may be hundreds of these, until somebody gives the bench back.
            with suppress(OSError):
                log.unlink()
        return ended

    def outlived(self, job: Job) -> bool:
        """Return whether a job needs no start; see `Runner`."""
        folder = self._folder(job)
        return folder is not None and bool(is_held(folder / LOCK) or _status(folder) == "done")

    def _new_log(self, job: Job) -> Path:
        """Return an empty file for what this attempt prints; of those before, the newest stay."""
        self._logs.mkdir(parents=True, exist_ok=True)
        logs = sorted(self._logs.glob("job-*.log"), key=_changed)
        for old in logs[: -(LOGS_KEPT - 1)]:
            with suppress(OSError):
                old.unlink()
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
            changed = [_changed(path) for path in signs]
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
    """Return how an attempt ended: by its exit code, or by run.json if there is none to be had.

    What run.json says of a child may be of an attempt before, if this one did not come that far.
    """
    info = {} if folder is None else _info(folder)
    run, status = None if folder is None else str(folder), info.get("status", "")
    if code == 0 or status == "done":
        return Ended("done", run=run)
    last = _last_line(log) or info.get("reason") or "it ended without a word"
    if tells_busy(last):
        return Ended("busy", last, run)
    how = BY_STATUS.get(status) if code is None else BY_CODE.get(code)
    return Ended(how or "failed", last, run)


def _last_line(log: Path) -> str:
    try:
        text = log.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
    return text.rpartition("\n")[2]


def _changed(path: Path) -> float:
    """Return when a file was changed last, 0 if it is gone: other services remove logs, too."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


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
