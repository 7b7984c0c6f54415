"""What the last day brought, in words and plots, for those who do not look every day."""

import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from labdrive.model.units import format_si
from labdrive.report.history import Trend, trend
from labdrive.report.trend import draw_trend
from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import Job, Queue


@contextmanager
def digest(queue: Queue, since: datetime, until: datetime) -> Iterator[tuple[str, str, list[Path]]]:
    """Yield title, text and plots of what ended between two times, or was due and has not ended.

    There is a plot for each schedule with an `alarm` of which at least five runs are done; plots
    live as long as the block.
    """
    # By its end: what was under way when a digest was sent belongs into the next.
    first, last = since.isoformat(), until.isoformat()
    jobs = [job for job in queue.jobs() if first < (job.ended or job.due) <= last]
    with tempfile.TemporaryDirectory() as folder:
        lines, plots = [], []
        for one in queue.schedules():
            entry = one.entry
            mine = [job for job in jobs if job.schedule == entry.name]
            lines += _lines(entry.name, mine)
            history = _history(entry, queue)
            if history is not None:
                lines.append(_last(history))
                plots.append(Path(folder) / f"{entry.name}.svg")
                draw_trend(history, plots[-1])
        failed = sum(job.state == "failed" for job in jobs)
        done = sum(job.state == "done" for job in jobs)
        yield f"labdrive: {done} done, {failed} failed", "\n".join(lines), plots


def _lines(name: str, jobs: list[Job]) -> list[str]:
    counts = Counter(job.state for job in jobs)
    told = ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
    failures = [f"  {job.due}: {job.reason}" for job in jobs if job.state == "failed"]
    return [f"{name}: {told or 'nothing was due'}", *failures]


def _history(entry: Schedule, queue: Queue) -> Trend | None:
    """Return the history that a schedule's alarm is about, from where its last run is."""
    runs = [job.run for job in queue.jobs("done") if job.schedule == entry.name and job.run]
    if entry.alarm is None or not runs:
        return None
    return trend(Path(runs[-1]).parent, entry.alarm, str(entry.bench), str(entry.recipe))


def _last(history: Trend) -> str:
    last = history.points[-1]
    value, low, high = (
        format_si(v, history.unit, 4) for v in (last.value, history.low, history.high)
    )
    return f"  {history.metric} {value}, limits {low} to {high} {last.alarm}".rstrip()
