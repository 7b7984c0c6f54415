"""What becomes of due times: queued, or skipped because they were missed or would overlap."""

from datetime import datetime, timedelta

from labdrive.schedule.calendar import due_times
from labdrive.schedule.entry import Schedule
from labdrive.schedule.queue import State

# Later than that and it was due while nobody looked.
LATE = timedelta(seconds=60)

Due = tuple[datetime, State, str]


def become_due(schedule: Schedule, after: datetime, now: datetime, unfinished: int) -> list[Due]:
    """Return every due time after `after` and up to `now`, with the state and reason it takes.

    `unfinished`: how many jobs of the schedule wait or run already.
    """
    times = list(due_times(schedule, after, now))
    late = [when for when in times if when < now - LATE]
    due = _missed(schedule, late) if late else []
    due += [(when, "queued", "") for when in times[len(late) :]]
    return _without_overlap(due, unfinished) if schedule.overlap == "skip" else due


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
