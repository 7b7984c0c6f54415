"""Simulated actuators: generators that play a table to a plant."""

from collections.abc import Generator, Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.legs_file import read_legs
from labdrive.interfaces.quantities import InputFile, Length, LengthPerVoltage
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive.periodic.legs import LegModel, predicted_step, tips, walking_table
from labdrive.periodic.phase_map import node_phases
from labdrive.periodic.reversal import swapped
from labdrive.periodic.trajectories import TRAJECTORIES
from labdrive_sim.plant import plant_of
from labdrive_sim.table_player import TablePlayer


class PlayerSettings(SettingsBase):
    """What every simulated actuator has."""

    link: str = Field(description="The bench's plant that the actuator drives.")
    table_length: int = Field(
        default=4096, ge=64, le=1 << 20, description="Entries of the table that one cycle holds."
    )
    speed: Literal["fast"] | Annotated[float, Field(gt=0)] = Field(
        default="fast", description="A multiple of real time (1: real time), or `fast`."
    )


class WalkingActuator:
    """Generator and amplifiers of a walking drive: four voltages, played from a table."""

    class Settings(PlayerSettings):
        """Settings of the generator; the leg model is the one assumed, not the plant's."""

        x_per_volt: LengthPerVoltage = Field(default=0.036e-6, gt=0)
        y_per_volt: LengthPerVoltage = Field(default=0.025e-6, gt=0)
        legs: InputFile | None = Field(
            default=None,
            description="The legs.json of an identify_legs run, instead of x_per_volt, y_per_volt.",
        )

    sampling = Sampling.TRIGGERED
    position_unit = "m"
    fixed_motion: Motion | None = None

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._limits = context.limits
        self._trajectories = {**TRAJECTORIES, **context.trajectories}
        self._legs = _legs(settings)
        self._player = player(settings, context, channels=4)

    @property
    def max_samples_per_period(self) -> int:
        """A sensor can be latched on each entry of the table."""
        return self._settings.table_length

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the voltages that bring the tips along the trajectory, by the assumed model."""
        allowed = self._limits.voltage
        if waveform is None:
            raise InputError(Problem("missing: say which trajectory the legs take", "waveform"))
        if allowed is None:
            raise InputError(Problem("the bench must give limits.voltage", "waveform.amplitude"))
        return walking_table(
            waveform.path(self._trajectories),
            self._legs,
            allowed.min,
            allowed.max,
            peak_to_peak=None if waveform.amplitude == "max" else waveform.amplitude,
            x_scale=waveform.x_scale,
            y_scale=waveform.y_scale,
            length=self._settings.table_length,
            keep_pretension=waveform.pretension == "keep",
        )

    def tips(self, table: WaveformTable) -> Mapping[str, FloatArray]:
        """Return the tips of the legs [m], by the assumed model."""
        return tips(table, self._legs)

    def mirrored(self, table: WaveformTable) -> WaveformTable:
        """Return the table with the elements of each leg swapped and the phase inverted."""
        return swapped(table)

    def travel_per_period(self, table: WaveformTable) -> float:
        """Return the step [m] by the assumed model of the legs."""
        return predicted_step(table, self._legs)

    def check(self, motion: Motion) -> None:
        """Refuse samples a cycle that are not a whole number of entries apart."""
        self._player.check(motion)

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def reference(self) -> None:
        """Bring all voltages to 0 V, where every leg clamps."""
        self._player.ramp(np.zeros(4))

    def load(self, table: WaveformTable) -> None:
        """Ramp the voltages to the start of the table, which is played from now on."""
        self._player.load(table)

    def play(self, acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Walk the motion."""
        return self._player.play(acquisition)

    def relive(self, motion: Motion) -> None:
        """Let the plant follow a motion that an earlier process had finished."""
        self._player.relive(motion)

    def make_safe(self) -> None:
        """Bring all voltages to 0 V, where every leg clamps."""
        self._player.ramp(np.zeros(4))


def _legs(settings: WalkingActuator.Settings) -> LegModel:
    """Return the assumed model of the legs."""
    if settings.legs is not None:
        return read_legs(settings.legs).legs
    return LegModel.bending(settings.x_per_volt, settings.y_per_volt)


class SpindleActuator:
    """Motor of a lead screw: follows an angle, played from a table."""

    class Settings(PlayerSettings):
        """Settings of the drive; the lead is the nominal one."""

        lead: Length = Field(default=1e-3, gt=0)

    sampling = Sampling.TRIGGERED
    position_unit = "m"
    fixed_motion: Motion | None = None

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._player = player(settings, context, channels=1)

    @property
    def max_samples_per_period(self) -> int:
        """A sensor can be latched on each entry of the table."""
        return self._settings.table_length

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the angle that is the phase."""
        if waveform is not None:
            raise InputError(
                Problem("a spindle has no choice of waveform; leave it out", "waveform")
            )
        angle = Channel("angle", "rad", node_phases(self._settings.table_length), advance=TURN)
        return WaveformTable((angle,))

    def travel_per_period(self, table: WaveformTable) -> float:
        """Return the lead [m]."""
        return self._settings.lead * table.channels[0].advance / TURN

    def check(self, motion: Motion) -> None:
        """Refuse samples a cycle that are not a whole number of entries apart."""
        self._player.check(motion)

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def reference(self) -> None:
        """Stand still: the angle is known."""

    def load(self, table: WaveformTable) -> None:
        """Turn to the nearest start of the table, which is played from now on."""
        self._player.load(table)

    def play(self, acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Walk the motion."""
        return self._player.play(acquisition)

    def relive(self, motion: Motion) -> None:
        """Let the plant follow a motion that an earlier process had finished."""
        self._player.relive(motion)

    def make_safe(self) -> None:
        """Stand still: a lead screw holds its load."""


def player(settings: PlayerSettings, context: DeviceContext, channels: int) -> TablePlayer:
    """Return what plays tables to the plant that the settings name; InputError if it cannot be."""
    plant = plant_of(context, f"actuators.{context.name}.link", settings.link, channels)
    speed = None if settings.speed == "fast" else settings.speed
    return TablePlayer(plant, settings.table_length, speed)
