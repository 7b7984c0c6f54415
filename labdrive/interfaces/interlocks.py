"""The `interlocks` section of a bench: conditions under which a run may start and go on."""

import math
import re
from datetime import datetime, time
from typing import Annotated, Literal, Self
from zoneinfo import ZoneInfo

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from labdrive.interfaces.quantities import AnyQuantity, Time
from labdrive.interfaces.settings import SensorName, Settings
from labdrive.interfaces.time_zone import TimeZone
from labdrive.model.arrays import FloatArray
from labdrive.model.units import format_si

_SPAN = re.compile(r"([01]\d|2[0-3]):([0-5]\d)-([01]\d|2[0-3]):([0-5]\d)")


def _span(text: str) -> str:
    if not _SPAN.fullmatch(text):
        raise ValueError("write it as 22:00-06:00, in quotes")
    return text


class Interlock(Settings):
    """One condition: on a sensor's readings, or on the time of day."""

    sensor: SensorName | None = None
    below: AnyQuantity | None = None
    above: AnyQuantity | None = None
    within: AnyQuantity | None = Field(
        default=None, description="This far from `of`, or from the run's first reading."
    )
    of: AnyQuantity | None = None
    between: Annotated[str, AfterValidator(_span)] | None = Field(
        default=None, description="Times of day, as '22:00-06:00'."
    )
    tz: TimeZone = "UTC"
    action: Literal["hold", "pause", "stop"] = Field(
        default="stop",
        description="hold: no recording begins while it does not hold; for the time of day, and "
        "sensors that can be read at rest. pause: nor goes one on; it is halted, and made again "
        "later. stop: the run ends.",
    )
    again_after: Time = Field(
        default=60.0, gt=0, description="How long a paused recording waits, for a sensor's sake."
    )

    @model_validator(mode="after")
    def _one_condition(self) -> Self:
        bounds = [self.below, self.above, self.within]
        given = sum(bound is not None for bound in bounds)
        if (self.sensor is None) == (self.between is None):
            raise ValueError("give either a sensor or `between`")
        if self.sensor is not None and given != 1:
            raise ValueError("a sensor needs one of below, above, within")
        if self.sensor is None and (given or self.of is not None):
            raise ValueError("below, above, within and of belong to a sensor")
        if self.of is not None and self.within is None:
            raise ValueError("`of` belongs to within")
        if self.action == "hold" and self.within is not None and self.of is None:
            raise ValueError("before a start there is no first reading; say within of what")
        return self

    @property
    def quantities(self) -> list[AnyQuantity]:
        """The values it compares readings with."""
        return [q for q in (self.below, self.above, self.within, self.of) if q is not None]

    def range(self, first: float) -> tuple[float, float]:
        """Return between which values readings have to be.

        `first` is the sensor's first reading in the run [the sensor's unit].
        """
        if self.below is not None:
            return -math.inf, self.below.value
        if self.above is not None:
            return self.above.value, math.inf
        if self.within is not None:
            middle = first if self.of is None else self.of.value
            return middle - self.within.value, middle + self.within.value
        return -math.inf, math.inf

    def broken_at(self, values: FloatArray, first: float) -> int | None:
        """Return the index of the first of some readings that breaks it, None if none does.

        `first` is the sensor's first reading in the run [the sensor's unit].
        """
        low, high = self.range(first)
        # Within reaches to its ends; below and above do not.
        outside = (values < low) | (values > high)
        broken = outside if self.within is not None else outside | np.isin(values, (low, high))
        return int(np.argmax(broken)) if broken.any() else None

    def holds_at(self, now: datetime) -> bool:
        """Return whether a condition on the time of day holds; True for one on a sensor."""
        if self.between is None:
            return True
        start, end = (time.fromisoformat(part) for part in self.between.split("-"))
        here = now.astimezone(ZoneInfo(self.tz)).time()
        if start <= end:
            return start <= here < end
        return here >= start or here < end

    def __str__(self) -> str:
        """Return the condition as a person says it."""
        if self.between is not None:
            return f"only {self.between} {self.tz}"
        name, bound = next(
            (name, getattr(self, name))
            for name in ("below", "above", "within")
            if getattr(self, name) is not None
        )
        of = "" if self.within is None else " of its first reading"
        of = of if self.of is None else f" of {format_si(self.of.value, self.of.unit)}"
        return f"{self.sensor} {name} {format_si(bound.value, bound.unit)}{of}"
