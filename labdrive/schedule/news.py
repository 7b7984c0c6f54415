"""What people are told: jobs that failed for good, results out of control, the digest.

What cannot be told is logged, and stops nothing: neither a job nor the service hangs on it.
"""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from pathlib import Path
from typing import Protocol

from labdrive.model.units import format_si
from labdrive.report.history import numbers, trend
from labdrive.report.run_data import RunData
from labdrive.schedule.digest import digest
from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Queue

log = logging.getLogger(__name__)


class Tell(Protocol):
    """Sends a message to whoever should know."""

    async def __call__(self, title: str, body: str, plots: Sequence[Path] = ()) -> None:
        """Send it."""


async def nobody(title: str, body: str, plots: Sequence[Path] = ()) -> None:
    """Tell nobody."""


class News:
    """Makes messages of what happened, and has them sent."""

    def __init__(self, queue: Queue, tell: Tell) -> None:
        self._queue = queue
        self._tell = tell
        self._missing: set[tuple[str, str]] = set()

    async def failed(self, schedule: Schedule, reason: str, run: str | None) -> None:
        """Tell of a job that failed for good."""
        with _no_harm(f"that {schedule.name} failed"):
            await self._tell(
                f"labdrive: {schedule.name} failed", f"{reason}\n{_where(schedule, run)}"
            )

    async def done(self, schedule: Schedule, run: str | None) -> None:
        """Tell of a result that is out of control, or that lacks what should be watched."""
        if schedule.alarm is None or run is None:
            return
        with _no_harm(f"what {schedule.alarm} of {run} came to"):
            alarm = self._missed(schedule, schedule.alarm, run) or _alarm(
                schedule, schedule.alarm, Path(run)
            )
            if alarm:
                await self._tell(
                    f"labdrive: {schedule.name} alarm", f"{alarm}\n{_where(schedule, run)}"
                )

    async def last_day(self, now: datetime) -> None:
        """Send the digest."""
        with (
            _no_harm("what the last day brought"),
            digest(self._queue, now - timedelta(days=1), now) as (title, body, plots),
        ):
            await self._tell(title, body, plots)

    def _missed(self, schedule: Schedule, metric: str, run: str) -> str:
        """Return, once, that a result lacks the number to watch; each run would say the same."""
        there = numbers(RunData(Path(run)))
        if metric in there or (schedule.name, metric) in self._missing:
            return ""
        self._missing.add((schedule.name, metric))
        text = (
            f"the result has no {metric} to watch; name another in the schedule's alarm: "
            f"{', '.join(there) or 'it holds no numbers'}"
        )
        log.warning("%s: %s", schedule.name, text)
        return text


@contextmanager
def _no_harm(what: str) -> Iterator[None]:
    """Log what goes wrong in the block."""
    try:
        yield
    except Exception:
        log.exception("it could not be told %s", what)


def _where(schedule: Schedule, run: str | None) -> str:
    return f"recipe {schedule.recipe}\nbench {schedule.bench}\nrun {run or 'none'}"


def _alarm(schedule: Schedule, metric: str, run: Path) -> str:
    """Return what is remarkable of a run's result among those before it, "" if nothing."""
    found = trend(run.parent, metric, str(schedule.bench), str(schedule.recipe))
    if found is None or found.points[-1].run != run.name or not found.points[-1].alarm:
        return ""
    value, low, high = (
        format_si(v, found.unit, 4) for v in (found.points[-1].value, found.low, found.high)
    )
    return f"{metric} {value}: {found.points[-1].alarm} ({low} to {high})"
