"""When a schedule is due, in UTC."""

from collections.abc import Iterator
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

from labdrive.schedule.entry import Schedule


def due_times(schedule: Schedule, after: datetime, until: datetime) -> Iterator[datetime]:
    """Yield the times at which it is due, later than `after` and not later than `until`, in UTC.

    Daylight saving is as in Debian's cron: a time that the clock skips in spring is due when it has
    skipped it, a time that comes twice in autumn is due the first time only.
    """
    for due in _from(schedule, after):
        if due > until:
            return
        yield due


def next_due(schedule: Schedule, after: datetime) -> datetime | None:
    """Return the first time after `after`, in UTC; None for a date that never comes."""
    return next(_from(schedule, after), None)


def _from(schedule: Schedule, after: datetime) -> Iterator[datetime]:
    from cronsim import CronSim

    for due in CronSim(schedule.cron, after.astimezone(ZoneInfo(schedule.tz))):
        yield due.astimezone(UTC)
