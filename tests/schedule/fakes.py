"""A clock and a runner of the test's own."""

import asyncio
from datetime import UTC, datetime, timedelta
from pathlib import Path

from labdrive.schedule.entry import Schedule
from labdrive.schedule.service import Ended

START = datetime(2026, 3, 2, 12, tzinfo=UTC)


def schedule(name="one", cron="* * * * *", bench="bench.yaml", **fields):
    defaults = {
        "tz": "UTC",
        "missed": "run_once",
        "overlap": "queue",
        "retries": 0,
        "hang_after": 600.0,
        "resume": True,
        "alarm": None,
    }
    return Schedule.model_construct(
        name=name, cron=cron, recipe=Path("r.yaml"), bench=Path(bench), **(defaults | fields)
    )


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self):
        self.now = START

    def __call__(self):
        return self.now

    def go(self, **by):
        self.now += timedelta(**by)


class Runner:
    """Notes what it is asked to run; ends as told, after `seconds` of the test's clock."""

    def __init__(self, *ends, keep=True):
        self.keep = keep
        self.count = 0
        self.ran = []
        self.ends = list(ends)
        self.at_work = set()
        self.alive = set()

    def outlived(self, job):
        return job.id in self.alive

    async def run(self, job, entry):
        assert job.bench not in self.at_work
        self.at_work.add(job.bench)
        await asyncio.sleep(0)
        self.at_work.remove(job.bench)
        self.count += 1
        if self.keep:
            self.ran.append((job.schedule, job.due, job.attempts))
        return self.ends.pop(0) if self.ends else Ended("done", run=f"runs/{job.id}")
