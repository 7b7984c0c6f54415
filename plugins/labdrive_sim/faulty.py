"""A simulated interferometer that fails on demand, to try what becomes of a run, or of a plugin."""

import time
from typing import Literal

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Length
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive_sim.interferometer import Interferometer

Fault = Literal["none", "freeze", "time_out", "disconnect", "nan", "stuck", "silent", "lie"]


class FaultyInterferometer:
    """Reads as `sim-interferometer` does, up to the recording in which the fault strikes.

    freeze: never returns. time_out, disconnect: an error, at reading or at connecting. nan: no
    number. stuck: the last number for ever, 0 if there was none. silent: nothing. lie: off by
    `off`.
    """

    class Settings(Interferometer.Settings):
        """Settings of the instrument, and of its fault."""

        fault: Fault = "none"
        in_recording: int = Field(default=1, ge=1, description="From which recording on.")
        motions: int | None = Field(
            default=None, ge=1, description="How many motions it lasts; for ever by default."
        )
        after: int = Field(default=0, ge=0, description="How many samples it reads rightly first.")
        off: Length = Field(default=1e-6, description="For `lie`.")

    unit = "m"

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._sound = Interferometer(settings, context)
        self.samplings = self._sound.samplings
        self._name = context.name
        self._strikes = False
        self._struck = 0
        self._sound_left = settings.after
        self._last = 0.0

    def connect(self) -> None:
        """Connect, unless that is what fails."""
        if self._settings.fault == "disconnect":
            raise DeviceError(f"{self._name} does not answer; is it switched on?")
        self._sound.connect()

    def close(self) -> None:
        """Nothing to release."""
        self._sound.close()

    def arm(self, acquisition: Acquisition) -> None:
        """Get ready; from the set recording on the fault strikes."""
        settings = self._settings
        over = settings.motions is not None and self._struck >= settings.motions
        self._strikes = acquisition.number >= settings.in_recording and not over
        self._struck += self._strikes
        self._sound.arm(acquisition)

    def read(self, samples: Samples) -> Reading:
        """Return the readings, or fail."""
        reading = self._sound.read(samples)
        sound = self._sound_of(len(reading.value))
        if sound == len(reading.value):
            self._last = float(reading.value[-1]) if sound else self._last
            return reading
        return self._failed(reading, sound)

    def _sound_of(self, count: int) -> int:
        """Return how many of so many samples are read before the fault strikes."""
        if not self._strikes or self._settings.fault in {"none", "disconnect"}:
            return count
        sound = min(count, self._sound_left)
        self._sound_left -= sound
        return sound

    def _failed(self, reading: Reading, sound: int) -> Reading:
        """Return a reading whose first samples alone are sound, or fail."""
        fault = self._settings.fault
        if fault == "freeze":
            while True:
                time.sleep(1)
        if fault == "time_out":
            raise DeviceError(f"{self._name} timed out after 1 s; check its cable")
        if fault == "silent":
            return Reading(reading.value[:sound], reading.time[:sound])
        value = reading.value.copy()
        if sound:
            self._last = float(value[sound - 1])
        value[sound:] = self._spoilt(fault, value[sound:])
        return Reading(value, reading.time)

    def _spoilt(self, fault: Fault, value: FloatArray) -> FloatArray:
        if fault == "nan":
            return np.full_like(value, np.nan)
        if fault == "stuck":
            return np.full_like(value, self._last)
        return np.asarray(value + self._settings.off if fault == "lie" else value)
