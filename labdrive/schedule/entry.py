"""A schedule: which recipe on which bench, when, and what to do if that cannot be."""

import re
from datetime import UTC, datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from labdrive.interfaces.quantities import InputFile, Time
from labdrive.interfaces.settings import Settings
from labdrive.interfaces.time_zone import TimeZone


def _cron(text: str) -> str:
    from cronsim import CronSim, CronSimError

    try:
        CronSim(text, datetime.now(UTC))
    except CronSimError as error:
        message = f"is no cron expression of five fields, as 0 2 * * * ({error})"
        raise ValueError(message) from error
    return text


def _name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", name):
        raise ValueError("a name begins with a letter or digit and goes on with those, _ . or -")
    return name


class Schedule(Settings):
    """One line of the calendar."""

    name: Annotated[str, AfterValidator(_name)]
    recipe: InputFile
    bench: InputFile | None = Field(default=None, description="Instead of the recipe's.")
    cron: Annotated[str, AfterValidator(_cron)] = Field(
        description="Minute, hour, day, month, day of the week: `0 2 * * *` is every night at two."
    )
    tz: TimeZone = "UTC"
    missed: Literal["run_once", "skip"] = Field(
        default="run_once",
        description="Due while the service was off: run the last of them, once, or none.",
    )
    overlap: Literal["queue", "skip"] = Field(
        default="queue", description="Due while an earlier one still waits or runs."
    )
    retries: int = Field(
        default=0,
        ge=0,
        le=10,
        description="After a failure or a hang, 30 s later, then 60 s, and so on; never after an "
        "interlock.",
    )
    hang_after: Time = Field(
        default=600.0, gt=0, description="A run that shows no sign of life for so long is stopped."
    )
    resume: bool = Field(
        default=True, description="Go on with a run that was cut short, rather than begin again."
    )
    alarm: str | None = Field(
        default=None,
        description="A number of the result, as periodic_error.rms, that is told of when it leaves "
        "its control limits or drifts.",
    )


class Digest(Settings):
    """When the digest is due."""

    digest: Annotated[str, AfterValidator(_cron)]
    tz: TimeZone = "UTC"


class ScheduleFile(Settings):
    """schedules.yaml."""

    schedules: tuple[Schedule, ...]
