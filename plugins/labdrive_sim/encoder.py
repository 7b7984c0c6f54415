"""A simulated linear encoder: a grating's subdivisional error, and quantization."""

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Angle, Length
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN
from labdrive_sim.noise import generators
from labdrive_sim.plant import View, plant_of


class SubdivisionalHarmonic(SettingsBase):
    """A harmonic of the subdivisional error, in cycles a grating period."""

    order: int = Field(ge=1)
    amplitude: Length
    phase: Angle = 0.0


class Encoder:
    """Reads the plant's position [m] off a grating."""

    class Settings(SettingsBase):
        """What the instrument does to the truth."""

        link: str = Field(description="The bench's plant that the sensor looks at.")
        resolution: Length = Field(default=1.2207e-9, gt=0)
        grating_period: Length = Field(default=20e-6, gt=0)
        subdivisional_error: tuple[SubdivisionalHarmonic, ...] = ()
        noise: Length = Field(default=0.5e-9, ge=0, description="White, rms, before quantization.")

    unit = "m"
    samplings = frozenset({Sampling.TRIGGERED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        self._plant = plant_of(context, f"sensors.{context.name}.link", settings.link)

    @property
    def periods(self) -> tuple[float, ...]:
        """The periods of its subdivisional errors [m]."""
        settings = self._settings
        return tuple(settings.grating_period / e.order for e in settings.subdivisional_error)

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def read_at_rest(self) -> float:
        """Return what it would read now, without its noise."""
        return float(self._plant.stretch.position[-1])

    def arm(self, acquisition: Acquisition) -> None:
        """Start the noise of this recording."""
        (self._white,) = generators(self._context, acquisition, 1)
        self._view = View(self._plant)

    def read(self, samples: Samples) -> Reading:
        """Return a reading a sample, in whole counts of the resolution."""
        settings = self._settings
        position = self._view.stretch.at("position", samples.time)
        seen = position + settings.noise * self._white.standard_normal(len(position))
        for harmonic in settings.subdivisional_error:
            angle = harmonic.order * TURN * position / settings.grating_period + harmonic.phase
            seen = seen + harmonic.amplitude * np.sin(angle)
        counts = np.round(seen / settings.resolution)
        return Reading(counts * settings.resolution, samples.time)
