"""The service: queues what is due, runs what is queued, one job at a time on a bench."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal, Protocol

from labdrive.model.units import format_si
from labdrive.report.history import trend
from labdrive.schedule.calendar import due_times
from labdrive.schedule.digest import digest
from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Job, Queue, Scheduled, State
from labdrive.schedule.workers import Worker, is_alive

log = logging.getLogger(__name__)

POLL_S = 1.0
# Later than that and it was due while nobody looked.
LATE = timedelta(seconds=60)
BUSY_AGAIN = timedelta(seconds=30)

Clock = Callable[[], datetime]
Due = tuple[datetime, State, str]


@dataclass(frozen=True)
class Ended:
    """How a job's process ended; `run` is its folder, if it got that far.

    `busy`: somebody else has the bench; `hung`: it showed no sign of life and was stopped;
    `stopped`: the service itself is being stopped.
    """

    how: Literal["done", "failed", "hung", "busy", "stopped"]
    reason: str = ""
    run: str | None = None


class Runner(Protocol):
    """Runs jobs; a process each, unless in tests."""

    async def run(self, job: Job, schedule: Schedule) -> Ended:
        """Run a job to its end. Cancelled, it stops the job in good order before it raises."""


class Tell(Protocol):
    """Sends a message to whoever should know."""

    async def __call__(self, title: str, body: str, plots: Sequence[Path] = ()) -> None:
        """Send it."""


async def _nobody(title: str, body: str, plots: Sequence[Path] = ()) -> None:
    """Tell nobody."""


class Service:
    """Queues and runs, until it is stopped; any number of services may share a queue."""

    def __init__(  # noqa: PLR0913 what a service works with, the clock for tests
        self,
        queue: Queue,
        runner: Runner,
        worker: Worker,
        clock: Clock = lambda: datetime.now(UTC),
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        tell: Tell = _nobody,
        digest_after: Callable[[datetime], datetime | None] = lambda _: None,
    ) -> None:
        self._queue = queue
        self._runner = runner
        self._worker = worker
        self._clock = clock
        self._sleep = sleep
        self._tell = tell
        self._digest_after = digest_after
        self._tasks: set[asyncio.Task[None]] = set()

    async def serve(self) -> None:
        """Go on until cancelled; running jobs are then stopped, and wait to be gone on with."""
        last = self._clock()
        try:
            while True:
                self.recover()
                self.queue_due()
                self.start_queued()
                last = await self.tell_digest(last)
                await self._sleep(POLL_S)
        finally:
            await self._stop()

    async def once(self) -> None:
        """Queue what is due, run all that can be run, and return."""
        self.recover()
        self.queue_due()
        try:
            while self.start_queued() or self._tasks:
                await asyncio.wait(self._tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await self._stop()

    async def tell_digest(self, last: datetime) -> datetime:
        """Tell of the last day if that is due; return when it was looked at last."""
        now, due = self._clock(), self._digest_after(last)
        if due is None or due > now:
            return last
        with digest(self._queue, now - timedelta(days=1)) as (title, body, plots):
            await self._tell(title, body, plots)
        return now

    def recover(self) -> None:
        """Let jobs wait again whose service is gone: it crashed, or lost its power."""
        now = self._clock()
        for job in self._queue.jobs("running"):
            if not is_alive(self._worker.folder, job.worker or ""):
                log.warning("job %d of %s was cut short; it waits again", job.id, job.schedule)
                self._queue.again(job.id, "cut short", None, now)

    def queue_due(self) -> int:
        """Queue every due time that has come to pass since the last look; return how many."""
        now = self._clock()
        return sum(self._queue_one(one, now) for one in self._queue.schedules() if not one.paused)

    def start_queued(self) -> int:
        """Start jobs on all benches that are free; return how many."""
        started = 0
        while (job := self._queue.claim(self._worker.name, self._clock())) is not None:
            task = asyncio.get_running_loop().create_task(self._run(job))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
            started += 1
        return started

    def _queue_one(self, one: Scheduled, now: datetime) -> int:
        """Queue what is due of one schedule; a clock that was set back makes nothing due twice."""
        times = list(due_times(one.entry, one.checked, now))
        if not times:
            return 0
        late = [when for when in times if when < now - LATE]
        due: list[Due] = _missed(one.entry, late) if late else []
        due += [(when, "queued", "") for when in times[len(late) :]]
        if one.entry.overlap == "skip":
            due = _without_overlap(due, self._queue.unfinished(one.entry.name))
        return self._queue.enqueue(one.entry.name, str(one.entry.bench), due, now)

    async def _run(self, job: Job) -> None:
        schedule = self._queue.schedule(job.schedule)
        if schedule is None:
            self._queue.finish(job.id, "failed", "its schedule was removed", None, self._clock())
            return
        log.info("job %d of %s begins, due %s", job.id, job.schedule, job.due)
        try:
            ended = await self._runner.run(job, schedule)
        except asyncio.CancelledError:
            self._queue.again(job.id, "the service was stopped", None, self._clock())
            raise
        except Exception as error:
            log.exception("job %d could not be run", job.id)
            ended = Ended("failed", f"{type(error).__name__}: {error}")
        self._note(job, schedule, ended)
        await self._tell_of(self._queue.job(job.id), schedule)

    async def _tell_of(self, job: Job, schedule: Schedule) -> None:
        """Tell of a job that failed for good, and of a result that is out of control."""
        where = f"recipe {schedule.recipe}\nbench {schedule.bench}\nrun {job.run or 'none'}"
        if job.state == "failed":
            await self._tell(f"labdrive: {job.schedule} failed", f"{job.reason}\n{where}")
        elif job.state == "done" and (alarm := _alarm(job, schedule)):
            await self._tell(f"labdrive: {job.schedule} alarm", f"{alarm}\n{where}")

    def _note(self, job: Job, schedule: Schedule, ended: Ended) -> None:
        """Note the end of a job, or let it wait once more."""
        now = self._clock()
        log.info("job %d of %s: %s %s", job.id, job.schedule, ended.how, ended.reason)
        if ended.how == "done":
            self._queue.finish(job.id, "done", "", ended.run, now)
        elif ended.how == "stopped":
            self._queue.again(job.id, ended.reason, ended.run, now)
        elif ended.how == "busy":
            self._queue.again(job.id, ended.reason, ended.run, now + BUSY_AGAIN)
        elif job.failures < schedule.retries:
            self._queue.again(job.id, f"{ended.how}: {ended.reason}", ended.run, now, failed=True)
        else:
            self._queue.finish(job.id, "failed", f"{ended.how}: {ended.reason}", ended.run, now)

    async def _stop(self) -> None:
        """Stop what runs, and wait until it has."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _missed(schedule: Schedule, late: list[datetime]) -> list[Due]:
    """Return what is to be done for due times that nobody looked at: one entry for all of them."""
    before = f", with {len(late) - 1} before it" if len(late) > 1 else ""
    if schedule.missed == "skip":
        return [(late[-1], "skipped", f"missed{before}")]
    return [(late[-1], "queued", f"late: missed{before}")]


def _without_overlap(due: list[Due], unfinished: int) -> list[Due]:
    """Return the due times, those skipped that would wait behind another of the same schedule."""
    kept: list[Due] = []
    for when, state, reason in due:
        waits = state == "queued"
        if waits and unfinished:
            kept.append((when, "skipped", "an earlier one still waited or ran"))
        else:
            kept.append((when, state, reason))
            unfinished += waits
    return kept


def _alarm(job: Job, schedule: Schedule) -> str:
    """Return what is remarkable of a job's result among those before it, "" if nothing."""
    if schedule.alarm is None or job.run is None:
        return ""
    run = Path(job.run)
    found = trend(run.parent, schedule.alarm, str(schedule.bench), str(schedule.recipe))
    if found is None or found.points[-1].run != run.name or not found.points[-1].alarm:
        return ""
    value, low, high = (
        format_si(v, found.unit, 4) for v in (found.points[-1].value, found.low, found.high)
    )
    return f"{schedule.alarm} {value}: {found.points[-1].alarm} ({low} to {high})"
