"""A job in a process of its own: started, watched for signs of life, stopped, made safe."""

import asyncio
import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Job
from labdrive.schedule.service import Ended
from labdrive.store.run_folder import ALIVE

LOOK_S = 0.5
# To end in good order after SIGTERM: halt, make safe, close the run folder.
GRACE_S = 15.0
SAFE_S = 60.0
JOB = "LABDRIVE_JOB"
BUSY = "is in use by"
NEWEST = 50


class ProcessRunner:
    """Runs `labdrive run` or `labdrive resume` for each job; what it prints is kept in `logs`."""

    def __init__(self, runs: Path, logs: Path) -> None:
        self._runs = runs
        self._logs = logs

    async def run(self, job: Job, schedule: Schedule) -> Ended:
        """Run a job; see `Runner`."""
        begun = self._begun(job, schedule)
        if begun is not None and _status(begun) == "done":
            return Ended("done", run=str(begun))
        self._logs.mkdir(parents=True, exist_ok=True)
        log = self._logs / f"job-{job.id}.log"
        with log.open("ab") as output:
            process = await asyncio.create_subprocess_exec(
                *_command(begun, schedule, self._runs),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**os.environ, JOB: str(job.id)},
                # Ctrl-C at a terminal is for the service, which then stops its runs itself.
                start_new_session=True,
            )
        try:
            hung = await self._watched(process, job, schedule, log)
        except asyncio.CancelledError:
            await _stop(process)
            raise
        folder = self._folder(job)
        run = None if folder is None else str(folder)
        if hung:
            await _stop(process)
            safe = await _make_safe(schedule, log)
            return Ended("hung", f"no sign of life for {schedule.hang_after:g} s; {safe}", run)
        return _ended(process.returncode or 0, folder, run, log)

    async def _watched(
        self, process: asyncio.subprocess.Process, job: Job, schedule: Schedule, log: Path
    ) -> bool:
        """Wait for the process to end; return True if it shows no sign of life any more."""
        started = time.time()
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), LOOK_S)
                return False
            folder = self._folder(job)
            signs = [log] if folder is None else [log, folder / ALIVE, folder / "journal.jsonl"]
            last = max([started, *(path.stat().st_mtime for path in signs if path.exists())])
            if time.time() - last > schedule.hang_after:
                return True

    def _begun(self, job: Job, schedule: Schedule) -> Path | None:
        """Return the run folder to go on with, if this job has one and may."""
        return self._folder(job) if schedule.resume and job.attempts > 1 else None

    def _folder(self, job: Job) -> Path | None:
        """Return the run folder of a job, which its run.json names."""
        if job.run is not None and Path(job.run).is_dir():
            return Path(job.run)
        for path in sorted(self._runs.glob("*/run.json"), reverse=True)[:NEWEST]:
            if _info(path.parent).get("job") == str(job.id):
                return path.parent
        return None


def _command(begun: Path | None, schedule: Schedule, runs: Path) -> list[str]:
    labdrive = [sys.executable, "-m", "labdrive"]
    if begun is not None:
        return [*labdrive, "resume", str(begun)]
    bench = ["--bench", str(schedule.bench)] if schedule.bench else []
    return [*labdrive, "run", str(schedule.recipe), *bench, "--runs", str(runs)]


def _ended(code: int, folder: Path | None, run: str | None, log: Path) -> Ended:
    # A run of a service that was killed may have come to its end while this one began.
    if code == 0 or (folder is not None and _status(folder) == "done"):
        return Ended("done", run=run)
    last = _last_line(log)
    if folder is not None and _status(folder) == "interrupted":
        return Ended("stopped", last, run)
    return Ended("busy" if BUSY in last else "failed", last or f"exit code {code}", run)


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1] if lines else ""


def _info(folder: Path) -> dict[str, Any]:
    try:
        info = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return info if isinstance(info, dict) else {}


def _status(folder: Path) -> str:
    return str(_info(folder).get("status", ""))


async def _stop(process: asyncio.subprocess.Process) -> None:
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
