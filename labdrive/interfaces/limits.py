"""The `limits` section of a bench: what no recipe can exceed."""

from typing import Self

from pydantic import Field, model_validator

from labdrive.interfaces.quantities import (
    AngleOrLength,
    Capacitance,
    Current,
    Force,
    Frequency,
    SlewRate,
    Time,
    Voltage,
    unit_of,
)
from labdrive.interfaces.settings import Settings


class VoltageRange(Settings):
    """Lowest and highest voltage of any channel."""

    min: Voltage
    max: Voltage

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min >= self.max:
            raise ValueError("min must be below max")
        return self


class TravelRange(Settings):
    """Ends of the travel, in the unit of the position sensors."""

    min: AngleOrLength
    max: AngleOrLength

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if unit_of(self.min) != unit_of(self.max):
            raise ValueError("min and max must both be lengths or both be angles")
        if self.min >= self.max:
            raise ValueError("min must be below max")
        return self


class Amplifier(Settings):
    """What bounds the slew of a capacitive load: dU/dt = current / capacitance."""

    current: Current = Field(gt=0)
    capacitance: Capacitance = Field(gt=0)


class Limits(Settings):
    """Limits of a bench: checked before each motion and, where a sensor sees them, during it."""

    voltage: VoltageRange | None = Field(
        default=None, description="Required by actuators whose tables are in volts."
    )
    slew: SlewRate | None = Field(default=None, gt=0, description="Fastest change of a voltage.")
    amplifier: Amplifier | None = Field(
        default=None, description="Gives the slew where `slew` does not: current / capacitance."
    )
    travel: TravelRange | None = Field(
        default=None, description="Watched on every position sensor; required where things move."
    )
    force: Force | None = Field(
        default=None, gt=0, description="Largest force, either sign, on any force sensor."
    )
    period_rate: Frequency | None = Field(default=None, gt=0, description="Most cycles a second.")
    silence: Time = Field(
        default=30.0,
        gt=0,
        description="A run that moves and shows no reading for so long is ended from outside, and "
        "the bench made safe.",
    )
    lowest_resonance: Frequency | None = Field(
        default=None,
        gt=0,
        description="Of actuator and stage. A recipe whose waveform has harmonics beyond is warned "
        "about: the method asks for a motion slower than that.",
    )

    @property
    def travel_unit(self) -> str | None:
        """The unit of `travel`: m or rad; None if there is no such limit."""
        return unit_of(self.travel.min) if self.travel else None

    @property
    def slew_v_per_s(self) -> float | None:
        """The slew limit in V/s, from `slew` or the amplifier; None if neither is given."""
        if self.slew is not None or self.amplifier is None:
            return self.slew
        return self.amplifier.current / self.amplifier.capacitance
