"""The `motion` section of a recipe."""

from pydantic import Field, field_validator

from labdrive.interfaces.quantities import Frequency
from labdrive.interfaces.settings import Settings
from labdrive.model.motion import Direction, Motion

FEWEST_SAMPLES_PER_PERIOD = 16


class MotionSettings(Settings):
    """How to move: so many cycles, sampled so often, this fast."""

    periods: int = Field(default=32, ge=1, description="Cycles to record.")
    samples_per_period: int = Field(
        default=256, description="Samples in one cycle: even, 16 or more."
    )
    period_rate: Frequency = Field(gt=0, description="Cycles a second.")
    settle_periods: int = Field(
        default=2, ge=0, description="Cycles walked before recording begins."
    )
    direction: Direction = Field(
        default=Direction.FORWARD, description="Direction of travel; forward is rising phase."
    )
    return_to_start: bool = Field(
        default=True, description="Walk back after each recording, unrecorded."
    )

    @field_validator("samples_per_period")
    @classmethod
    def _resolves_the_cycle(cls, samples: int) -> int:
        if samples < FEWEST_SAMPLES_PER_PERIOD:
            raise ValueError(
                f"must be {FEWEST_SAMPLES_PER_PERIOD} or more: fewer do not resolve the cycle"
            )
        if samples % 2:
            raise ValueError(f"must be even, such as {samples + 1}: half a cycle is whole samples")
        return samples

    def motion(self) -> Motion:
        """Return the motion these settings describe."""
        return Motion(
            periods=self.periods,
            samples_per_period=self.samples_per_period,
            period_rate_hz=self.period_rate,
            settle_periods=self.settle_periods,
            direction=self.direction,
        )
