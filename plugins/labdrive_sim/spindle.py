"""A lead screw with its motor: an error that repeats each revolution, backlash, friction."""

from collections.abc import Sequence
from typing import Annotated, Protocol, Self

import numpy as np
from pydantic import Field, model_validator

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Angle, Force, Length, Quantity, Torque
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN, WaveformTable
from labdrive_sim.plant import Stretch
from labdrive_sim.spindle_model import Harmonics, Parameters
from labdrive_sim.table_player import walked

TorsionalStiffness = Annotated[float, Quantity("N*m/rad")]


class Harmonic(SettingsBase):
    """A harmonic of something that repeats each revolution."""

    order: int = Field(ge=1, description="Cycles a revolution.")
    phase: Angle | None = Field(default=None, description="At angle 0; drawn by the seed if none.")


class ScrewHarmonic(Harmonic):
    """A harmonic of the screw's error."""

    amplitude: Length


class DetentHarmonic(Harmonic):
    """A harmonic of the motor's detent, also called cogging."""

    torque: Torque = Field(description="Amplitude.")


SCREW_ERROR = tuple(
    ScrewHarmonic.model_construct(order=order, amplitude=amplitude)
    for order, amplitude in ((1, 2.5e-6), (2, 0.8e-6), (3, 0.3e-6))
)
# Five pole pairs: once a pole pair, twice, and four times a pole pair.
DETENT = tuple(
    DetentHarmonic.model_construct(order=order, torque=torque)
    for order, torque in ((5, 10e-3), (10, 5e-3), (20, 2.5e-3))
)


class Spindle:
    """The plant. Its parameters are nobody's business but its own: optimizers must not read them.

    Motor: stiffness (commanded - angle) = detent(angle) + load's torque. The screw follows the
    motor within the wind-up by friction, the nut follows lead turns + screw error within the
    backlash: both lags are plays.
    """

    class Settings(SettingsBase):
        """Physical parameters."""

        seed: int = Field(default=1, ge=0, description="Draws phases that are not given.")
        lead: Length = Field(default=1e-3, gt=0)
        screw_error: tuple[ScrewHarmonic, ...] = SCREW_ERROR
        detent: tuple[DetentHarmonic, ...] = DETENT
        stiffness: TorsionalStiffness = Field(
            default=5.0, gt=0, description="Of the motor about the angle commanded."
        )
        friction: Torque = Field(default=1e-3, ge=0, description="Between motor and screw.")
        backlash: Length = Field(default=2e-6, ge=0, description="From flank to flank.")
        load: Force = Field(default=0.0, description="External, against forward travel.")

        @model_validator(mode="after")
        def _turns_steadily(self) -> Self:
            """Refuse a detent so steep that the motor would jump from tooth to tooth."""
            steepest = sum(abs(h.torque) * h.order for h in self.detent)
            if steepest >= self.stiffness:
                raise ValueError(
                    f"the detent pulls with up to {steepest:.3g} N*m/rad, which is no less than "
                    f"the stiffness of {self.stiffness:.3g} N*m/rad: the motor would jump"
                )
            return self

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        self._parameters = parameters(settings)
        self._plays = np.zeros(3)
        self._outputs = np.zeros(1)
        self._stretch = Stretch.at_rest()

    def connect(self) -> None:
        """Compile the model, or load what was compiled before, so that no motion has to wait."""
        compiled_turn()(self._parameters, self._plays, np.zeros(0))

    def close(self) -> None:
        """Nothing to release."""

    @property
    def outputs(self) -> FloatArray:
        """The angle commanded last [rad], shape (1,)."""
        return self._outputs

    @property
    def lead(self) -> float:
        """Travel in a revolution [m]."""
        return self._settings.lead

    @property
    def motor_angle(self) -> float:
        """Where the motor stands [rad]: what its own encoder sees."""
        return float(self._plays[2])

    @property
    def stretch(self) -> Stretch:
        """The steps made by the last call of `follow`."""
        return self._stretch

    def follow(self, outputs: FloatArray, time: FloatArray, step_s: float) -> None:  # noqa: ARG002 nothing here depends on rate
        """Apply angles [rad], shape (steps, 1), each for `step_s`; `time` [s] names them."""
        commanded = np.ascontiguousarray(outputs[:, 0])
        position = compiled_turn()(self._parameters, self._plays, commanded)
        load, level = np.full(len(time), self._settings.load), np.zeros(len(time))
        self._stretch = Stretch(time, position, load, level)
        self._outputs = outputs[-1].copy()

    def truth(self, table: WaveformTable, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return phase [rad] and position [m] at every entry of the table, without any noise.

        A twin of the spindle turns, from rest. For tests only: it is what no bench can know, and
        neither may an optimizer.
        """
        return walked(Spindle(self._settings, self._context), table, motion)


class Turn(Protocol):
    """The compiled loop."""

    def __call__(self, p: Parameters, plays: FloatArray, commanded: FloatArray) -> FloatArray:
        """Return where the nut is [m] for each commanded angle [rad]."""


def compiled_turn() -> Turn:
    """Return the compiled loop: numba is imported here, where something is about to move."""
    from labdrive_sim.spindle_kernel import turn

    return turn


def parameters(settings: Spindle.Settings) -> Parameters:
    """Return the constants of the kernel."""
    random = np.random.default_rng(settings.seed)
    screw_error = [harmonic.amplitude for harmonic in settings.screw_error]
    detent = [harmonic.torque / settings.stiffness for harmonic in settings.detent]
    return Parameters(
        lead=settings.lead,
        screw_error=_harmonics(settings.screw_error, screw_error, random),
        detent=_harmonics(settings.detent, detent, random),
        twist=settings.load * settings.lead / TURN / settings.stiffness,
        wind_up=settings.friction / settings.stiffness,
        backlash=settings.backlash,
    )


def _harmonics(
    harmonics: Sequence[Harmonic], amplitudes: Sequence[float], random: np.random.Generator
) -> Harmonics:
    drawn = random.uniform(0, TURN, len(harmonics))
    phases = [d if h.phase is None else h.phase for h, d in zip(harmonics, drawn, strict=True)]
    orders = [float(harmonic.order) for harmonic in harmonics]
    return Harmonics(np.array(orders), np.array(amplitudes), np.array(phases))
