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
    for due in times(schedule.cron, schedule.tz, after):
        if due > until:
            return
        yield due


def next_due(schedule: Schedule, after: datetime) -> datetime | None:
    """Return the first time after `after`, in UTC; None for a date that never comes."""
    return next(times(schedule.cron, schedule.tz, after), None)


def times(cron: str, zone: str, after: datetime) -> Iterator[datetime]:
    """Yield the times of a cron expression in a time zone, later than `after`, in UTC."""
    from cronsim import CronSim

    for due in CronSim(cron, after.astimezone(ZoneInfo(zone))):
        yield due.astimezone(UTC)
