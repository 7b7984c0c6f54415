"""A simulated thermometer: a room that warms and cools with the time of day."""

import time

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Temperature, Time
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN
from labdrive_sim.noise import generators


class Thermometer:
    """Reads the temperature [K] of the room, by this computer's clock."""

    class Settings(SettingsBase):
        """How the room is, and what the instrument adds."""

        mean: Temperature = Field(default=293.15, gt=0)
        swing: Temperature = Field(default=0.2, ge=0, description="To either side of the mean.")
        period: Time = Field(default=86400.0, gt=0, description="Its phase is 0 at midnight UTC.")
        noise: Temperature = Field(default=2e-3, ge=0, description="White, rms.")

    unit = "K"
    samplings = frozenset({Sampling.TRIGGERED, Sampling.POLLED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        self._armed = 0.0

    def connect(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to release."""

    def read_at_rest(self) -> float:
        """Return what it would read now, without its noise."""
        return float(self._at(np.array([time.time()]))[0])

    def arm(self, acquisition: Acquisition) -> None:
        """Start the noise of this recording."""
        (self._white,) = generators(self._context, acquisition, 1)
        self._armed = time.time()

    def read(self, samples: Samples) -> Reading:
        """Return a reading a sample."""
        white = self._settings.noise * self._white.standard_normal(len(samples.time))
        return Reading(self._at(self._armed + samples.time) + white, samples.time)

    def _at(self, clock: FloatArray) -> FloatArray:
        settings = self._settings
        return settings.mean + settings.swing * np.sin(TURN * clock / settings.period)
