"""The service: queues what is due, runs what is queued, one job at a time on a bench."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, Protocol

from labdrive.model.errors import LabdriveError, StoreError
from labdrive.schedule.entry import Schedule
from labdrive.schedule.news import News, Tell, nobody
from labdrive.schedule.overdue import become_due
from labdrive.schedule.queue import FAR_AHEAD, Job, Queue, Scheduled
from labdrive.schedule.workers import Worker, is_alive

log = logging.getLogger(__name__)

POLL_S = 1.0
# What found its bench in use, or was stopped by somebody: at once it might be for ever.
AGAIN = timedelta(seconds=30)
# Between retries: so long after the first failure, twice that after the second, and so on.
RETRY = timedelta(seconds=30)
WRITE_AGAIN_S = 5.0

Clock = Callable[[], datetime]


@dataclass(frozen=True)
class Ended:
    """How a job's process ended; `run` is its folder, if it got that far.

    `busy`: somebody else has the bench; `hung`: it showed no sign of life and was stopped;
    `interlock`: a limit or condition of the bench stopped it, which trying again would only meet
    again; `stopped`: somebody stopped it, who was not this service.
    """

    how: Literal["done", "failed", "hung", "interlock", "busy", "stopped"]
    reason: str = ""
    run: str | None = None


class Runner(Protocol):
    """Runs jobs; a process each, unless in tests."""

    async def run(self, job: Job, schedule: Schedule) -> Ended:
        """Run a job to its end. Cancelled, it stops the job in good order before it raises."""

    def outlived(self, job: Job) -> bool:
        """Return whether a job needs no start: its run is at work, or came to its end meanwhile."""


class Service:
    """Queues and runs, until it is stopped; any number of services may share a queue."""

    def __init__(  # noqa: PLR0913 what a service works with, the clock for tests
        self,
        queue: Queue,
        runner: Runner,
        worker: Worker,
        clock: Clock = lambda: datetime.now(UTC),
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        tell: Tell = nobody,
        digest_after: Callable[[datetime], datetime | None] = lambda _: None,
    ) -> None:
        self._queue = queue
        self._runner = runner
        self._worker = worker
        self._clock = clock
        self._sleep = sleep
        self._news = News(queue, tell)
        self._digest_after = digest_after
        self._tasks: dict[int, asyncio.Task[None]] = {}
        self._troubles: set[str] = set()
        self._any_failed = False

    async def serve(self) -> None:
        """Go on until cancelled; running jobs are then stopped, and wait to be gone on with."""
        last = self._clock()
        try:
            while True:
                self._do(self.recover, self.queue_due, self.start_queued)
                last = await self.tell_digest(last)
                await self._sleep(POLL_S)
        finally:
            await self._stop()

    async def once(self) -> bool:
        """Queue what is due and run all that can be run; return whether all of it went well."""
        try:
            well = self._do(self.recover, self.queue_due, self.start_queued)
            while self._tasks:
                await asyncio.wait(self._tasks.values(), return_when=asyncio.FIRST_COMPLETED)
                well &= self._do(self.start_queued)
        finally:
            await self._stop()
        return well and not self._any_failed

    async def tell_digest(self, last: datetime) -> datetime:
        """Tell of the last day if that is due; return when it was looked at last."""
        now = self._clock()
        if last > now + FAR_AHEAD:
            return now
        due = self._digest_after(last)
        if due is None or due > now:
            return last
        await self._news.last_day(now)
        return now

    def recover(self) -> None:
        """Take over jobs whose service is gone, crashed or without power: they wait again.

        Those whose runs live on are watched instead, so that they cannot hang unseen.
        """
        now = self._clock()
        for job in self._queue.jobs("running"):
            if self._is_at_work(job):
                continue
            if not self._runner.outlived(job):
                log.warning("job %d of %s was cut short; it waits again", job.id, job.schedule)
                self._queue.recover(job, now)
            elif (mine := self._queue.take_over(job, self._worker.name, now)) is not None:
                log.warning("job %d of %s has outlived its service", job.id, job.schedule)
                self._start(mine)

    def queue_due(self) -> int:
        """Queue every due time that has come to pass since the last look; return how many."""
        now = self._clock()
        return sum(self._queue_one(one, now) for one in self._queue.schedules() if not one.paused)

    def start_queued(self) -> int:
        """Start jobs on all benches that are free; return how many."""
        started = 0
        while (job := self._queue.claim(self._worker.name, self._clock())) is not None:
            self._start(job)
            started += 1
        return started

    def _do(self, *steps: Callable[[], object]) -> bool:
        """Take steps, each whether or not another fails; return whether none did.

        A full disk, say, must not end the runs on other benches. What goes wrong is logged when it
        begins, not each second.
        """
        troubles: set[str] = set()
        for step in steps:
            try:
                step()
            except (LabdriveError, OSError) as error:
                troubles.add(str(error))
        for trouble in sorted(troubles - self._troubles):
            log.error("%s; this is tried again every second", trouble)
        if self._troubles and not troubles:
            log.info("the job store can be used again")
        self._troubles = troubles
        return not troubles

    def _is_at_work(self, job: Job) -> bool:
        """Return whether somebody sees to a running job; of our own, one whose task runs."""
        if job.worker == self._worker.name:
            return job.id in self._tasks
        return is_alive(self._worker.folder, job.worker or "")

    def _queue_one(self, one: Scheduled, now: datetime) -> int:
        """Queue what is due of one schedule; a clock that was set back makes nothing due twice."""
        name, after = one.entry.name, one.checked
        if after > now + FAR_AHEAD:
            # The clock was wrong once: waiting for it to get there would be silence for years.
            log.warning("%s was looked at last at %s, which is yet to come", name, after)
            self._queue.look_from(name, now)
            return 0
        unfinished = self._queue.unfinished(name) if one.entry.overlap == "skip" else 0
        due = become_due(one.entry, after, now, unfinished)
        return self._queue.enqueue(name, str(one.entry.bench), due, now) if due else 0

    def _start(self, job: Job) -> None:
        task = asyncio.get_running_loop().create_task(self._run(job))
        self._tasks[job.id] = task
        task.add_done_callback(lambda task: self._task_ended(job.id, task))

    def _task_ended(self, number: int, task: asyncio.Task[None]) -> None:
        if self._tasks.get(number) is task:
            del self._tasks[number]
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("job %d: %s; it is taken up again", number, error)

    async def _run(self, job: Job) -> None:
        schedule, now = self._queue.schedule(job.schedule), self._clock()
        if schedule is None:
            gone = "its schedule was removed"
            await self._write(job, lambda: self._queue.finish(job.id, "failed", gone, None, now))
            return
        log.info("job %d of %s begins, due %s", job.id, job.schedule, job.due)
        try:
            ended = await self._attempt(job, schedule)
        except asyncio.CancelledError:
            self._queue.again(job.id, "the service was stopped", None, self._clock())
            raise
        log.info("job %d of %s: %s %s", job.id, job.schedule, ended.how, ended.reason)
        await self._note(job, schedule, ended)

    async def _attempt(self, job: Job, schedule: Schedule) -> Ended:
        try:
            return await self._runner.run(job, schedule)
        except Exception as error:
            log.exception("job %d could not be run", job.id)
            return Ended("failed", f"{type(error).__name__}: {error}")

    async def _note(self, job: Job, schedule: Schedule, ended: Ended) -> None:
        """Note the end of a job and tell of it, or let it wait once more."""
        now, reason = self._clock(), f"{ended.how}: {ended.reason}"
        if ended.how == "done":
            await asyncio.gather(
                self._write(job, lambda: self._queue.finish(job.id, "done", "", ended.run, now)),
                self._news.done(schedule, ended.run),
            )
        elif ended.how in ("busy", "stopped"):
            later = now + AGAIN
            await self._write(
                job, lambda: self._queue.again(job.id, ended.reason, ended.run, later)
            )
        elif ended.how != "interlock" and job.failures < schedule.retries:
            later = now + RETRY * 2**job.failures
            await self._write(
                job, lambda: self._queue.again(job.id, reason, ended.run, later, failed=True)
            )
        else:
            self._any_failed = True
            await asyncio.gather(
                self._write(
                    job, lambda: self._queue.finish(job.id, "failed", reason, ended.run, now)
                ),
                self._news.failed(schedule, reason, ended.run or job.run),
            )

    async def _write(self, job: Job, change: Callable[[], None]) -> None:
        """Make a change to the queue, however long it takes: a full disk is made room on.

        Until then the job holds its bench.
        """
        told = False
        while True:
            try:
                change()
            except StoreError as error:
                if not told:
                    log.warning("job %d: what came of it cannot be noted yet: %s", job.id, error)
                told = True
                await self._sleep(WRITE_AGAIN_S)
            else:
                return

    async def _stop(self) -> None:
        """Stop what runs, and wait until it has."""
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)
