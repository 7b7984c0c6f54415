"""A lead screw with its motor: an error that repeats each revolution, backlash, friction."""

import math

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Angle, Force, Length
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN, WaveformTable
from labdrive_sim.plant import Stretch


class ScrewHarmonic(SettingsBase):
    """A harmonic of the screw's error, in cycles a revolution."""

    order: int = Field(ge=1)
    amplitude: Length
    phase: Angle = 0.0


class DetentHarmonic(SettingsBase):
    """A harmonic of the motor's detent, in cycles a revolution: how far it pulls the angle."""

    order: int = Field(ge=1)
    amplitude: Angle
    phase: Angle = 0.0


SCREW_ERROR = tuple(
    ScrewHarmonic.model_construct(order=order, amplitude=amplitude, phase=phase)
    for order, amplitude, phase in ((1, 2.5e-6, 0.4), (2, 0.8e-6, 1.9), (3, 0.3e-6, -0.7))
)
DETENT = tuple(
    DetentHarmonic.model_construct(order=order, amplitude=amplitude, phase=phase)
    for order, amplitude, phase in ((5, 2e-3, 0.2), (10, 1e-3, 2.6), (20, 0.5e-3, -1.1))
)


class Spindle:
    """The plant. Its parameters are nobody's business but its own: optimizers must not read them.

    Angle of the motor: commanded + detent, behind a wind-up by friction; position: lead times
    turns + screw error, behind the backlash. Both lags are plays.
    """

    class Settings(SettingsBase):
        """Physical parameters. Five pole pairs give a detent of 5, 10 and 20 a revolution."""

        seed: int = Field(default=1, ge=0, description="Draws nothing yet known of this plant.")
        lead: Length = Field(default=1e-3, gt=0)
        screw_error: tuple[ScrewHarmonic, ...] = SCREW_ERROR
        detent: tuple[DetentHarmonic, ...] = DETENT
        wind_up: Angle = Field(default=0.2e-3, ge=0, description="Twist before friction yields.")
        backlash: Length = Field(default=2e-6, ge=0)
        load: Force = Field(default=0.0, description="External, against forward travel.")

    def __init__(self, settings: Settings, _context: DeviceContext) -> None:
        self._settings = settings
        self._outputs = np.zeros(1)
        self._plays = np.zeros(2)
        self._stretch = Stretch(np.zeros(1), np.zeros(1))

    def connect(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to release."""

    @property
    def outputs(self) -> FloatArray:
        """The angle commanded last [rad], shape (1,)."""
        return self._outputs

    @property
    def stretch(self) -> Stretch:
        """The steps made by the last call of `follow`."""
        return self._stretch

    @property
    def load(self) -> float:
        """External force against forward travel [N]."""
        return self._settings.load

    def follow(self, outputs: FloatArray, time: FloatArray, step_s: float) -> None:
        """Apply angles [rad], shape (steps, 1), each for `step_s`; `time` [s] names them."""
        position = self._respond(outputs[:, 0], self._plays)
        before = min(self._stretch.time[-1], time[0] - step_s)
        self._stretch = Stretch(
            np.append(before, time), np.append(self._stretch.position[-1], position)
        )
        self._outputs = outputs[-1].copy()

    def truth(self, table: WaveformTable, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return phase [rad] and position [m] at every entry of the table, without any noise.

        A twin of the spindle, from rest. For tests only: it is what no bench can know, and neither
        may an optimizer.
        """
        length, sign = table.length, motion.direction.sign
        entries = np.arange(-motion.settle_periods * length, motion.periods * length + 1)
        phase = sign * TURN * entries / length
        position = self._respond(table.channels[0].at(phase), np.full(2, np.nan))
        return phase[entries >= 0], position[entries >= 0]

    def _respond(self, angle: FloatArray, plays: FloatArray) -> FloatArray:
        """Return the position [m] for each angle [rad]; `plays`, shape (2,), move on.

        A play that is NaN starts in the middle of its gap.
        """
        from labdrive_sim.spindle_kernel import follow_with_play  # noqa: PLC0415 numba, 0.1 s

        settings = self._settings
        pulled = angle + sum((wave(h, angle) for h in settings.detent), np.zeros(len(angle)))
        motor = follow_with_play(pulled, settings.wind_up, plays[:1])
        error = sum((wave(h, motor) for h in settings.screw_error), np.zeros(len(angle)))
        nut = settings.lead * motor / TURN + error
        return np.asarray(follow_with_play(nut, settings.backlash / 2, plays[1:]))


def wave(harmonic: ScrewHarmonic | DetentHarmonic, angle: FloatArray) -> FloatArray:
    """Return amplitude sin(order angle + phase), zero at angle 0; any shape."""
    turned = np.sin(harmonic.order * angle + harmonic.phase) - math.sin(harmonic.phase)
    return np.asarray(harmonic.amplitude * turned)
