"""What an actuator is asked to do: so many cycles, sampled so often, this fast."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum


class Direction(StrEnum):
    """Direction of travel: forward is rising phase."""

    FORWARD = "forward"
    BACKWARD = "backward"

    @property
    def sign(self) -> int:
        """+1 forward, -1 backward."""
        return 1 if self is Direction.FORWARD else -1

    @property
    def opposite(self) -> "Direction":
        """The other direction."""
        return Direction.BACKWARD if self is Direction.FORWARD else Direction.FORWARD


@dataclass(frozen=True)
class Motion:
    """A walk at constant phase rate: settling cycles first, then the recorded ones.

    The recorded phases run from 0 to direction * 2 pi * `periods`, both ends included, so that
    a triggered recording holds `periods * samples_per_period + 1` samples.
    """

    periods: int
    samples_per_period: int
    period_rate_hz: float
    settle_periods: int = 2
    direction: Direction = Direction.FORWARD

    @property
    def samples(self) -> int:
        """Samples in a triggered recording of this motion."""
        return self.periods * self.samples_per_period + 1

    @property
    def duration_s(self) -> float:
        """Time the motion takes, settling included, in s."""
        return (self.periods + self.settle_periods) / self.period_rate_hz

    @property
    def phase_span(self) -> float:
        """Phase walked, settling included, signed, in rad."""
        return self.direction.sign * 2 * math.pi * (self.periods + self.settle_periods)

    def returning(self) -> "Motion":
        """Return the motion that walks all of this one back, recording nothing."""
        cycles = self.periods + self.settle_periods
        return replace(self, periods=0, settle_periods=cycles, direction=self.direction.opposite)
