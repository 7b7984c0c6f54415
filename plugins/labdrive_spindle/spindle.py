"""What spindle drives have in common, whatever the bus: one revolution is one cycle."""

import math

import numpy as np
from pydantic import Field, model_validator

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Frequency, Length, Time
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive.periodic.phase_map import node_phases


class Turns(SettingsBase):
    """Where the drive may turn to, in revolutions from its home."""

    min: float
    max: float

    @model_validator(mode="after")
    def _in_order(self) -> "Turns":
        if self.min >= self.max:
            raise ValueError("min must be below max")
        return self


class Profile(SettingsBase):
    """How the drive moves by itself: to the start of a motion, back, and from step to step."""

    velocity: Frequency = Field(default=1.0, gt=0, description="Revolutions a second.")
    acceleration_time: Time = Field(
        default=0.1, gt=0, description="From standstill to that velocity."
    )


class Homing(SettingsBase):
    """How the drive finds its home (IEC 61800-7-201, homing methods)."""

    method: int = Field(
        ge=-128,
        le=37,
        description="33, 34: index pulse; 35, 37: where it stands; 1 to 30: "
        "limit and home switches.",
    )
    velocity: Frequency = Field(default=0.5, gt=0, description="Towards the switch, in rev/s.")
    slow: Frequency = Field(default=0.1, gt=0, description="Towards its edge, in rev/s.")
    timeout: Time = Field(default=60.0, gt=0)


class SpindleSettings(SettingsBase):
    """What every spindle drive has."""

    link: str = Field(description="The bench's bus that the drive is on.")
    lead: Length = Field(default=1e-3, gt=0, description="Nominal travel in a revolution.")
    table_length: int = Field(
        default=4096, ge=64, le=1 << 20, description="Entries of the table of one revolution."
    )
    counts_per_revolution: int | None = Field(
        default=None, ge=16, description="Of the drive's position; read from the drive by default."
    )
    velocity_units: float | None = Field(
        default=None,
        gt=0,
        description="The drive's units of velocity in a revolution a second: 60 if it counts in "
        "rpm. By default what the drive says (60A9h), or else counts a second.",
    )
    turns: Turns | None = Field(
        default=None, description="Range of the drive itself, checked before motion and by it."
    )
    profile: Profile = Field(default_factory=Profile)
    homing: Homing | None = Field(
        default=None, description="How to find its home; none if its encoder knows."
    )
    settle: Time = Field(
        default=0.02, ge=0, description="After each step, before reading, where it steps."
    )


def nominal_table(length: int, waveform: Waveform | None) -> WaveformTable:
    """Return the table whose angle is the phase; InputError if a waveform is asked for."""
    if waveform is not None:
        message = "a spindle has no choice of waveform; leave it out"
        raise InputError(Problem(message, "waveform"))
    return WaveformTable((Channel("angle", "rad", node_phases(length), advance=TURN),))


def angle_channel(table: WaveformTable) -> Channel:
    """Return the table's angle; DeviceError if a spindle cannot play it."""
    channel = table.channels[0]
    rising = np.diff(np.append(channel.samples, channel.samples[0] + channel.advance))
    if len(table.channels) != 1 or not math.isclose(channel.advance, TURN) or np.min(rising) <= 0:
        raise DeviceError("a spindle plays one angle that rises by a revolution in a cycle")
    return channel


def phase_of(channel: Channel, angle: FloatArray) -> FloatArray:
    """Return the phase [rad] at which the channel has each angle [rad]; any shape.

    The inverse of `Channel.at`, for angles that rise over the cycle.
    """
    length, start = len(channel.samples), float(channel.samples[0])
    nodes = np.append(channel.samples, start + channel.advance)
    cycle = np.floor((angle - start) / channel.advance)
    inside = angle - cycle * channel.advance
    phase = np.interp(inside, nodes, TURN * np.arange(length + 1) / length)
    return np.asarray(phase + TURN * cycle, dtype=np.float64)


def nearest_turn(channel: Channel, angle: float) -> float:
    """Return the whole turns [rad] from the table's start to the start nearest to an angle."""
    return TURN * round((angle - float(channel.samples[0])) / TURN)


def refuse_turns(turns: Turns | None, name: str, *angles: float) -> None:
    """Raise DeviceError if one of the angles [rad] is beyond the drive's range."""
    for turn in (angle / TURN for angle in angles):
        if turns is not None and not turns.min <= turn <= turns.max:
            raise DeviceError(
                f"refused before moving: {name} would turn to {turn:.3f} revolutions from home, "
                f"outside its range of {turns.min:g} to {turns.max:g}; home it, or move it back"
            )


def refuse_fast_profile(settings: SpindleSettings, context: DeviceContext) -> None:
    """Raise InputError if the drive may move by itself faster than the bench allows."""
    most, velocity = context.limits.period_rate, settings.profile.velocity
    if most is not None and velocity > most:
        field = f"actuators.{context.name}.profile.velocity"
        message = f"is above the bench's period_rate of {format_si(most, 'Hz')}"
        raise InputError(Problem(message, field, got=format_si(velocity, "Hz")))
