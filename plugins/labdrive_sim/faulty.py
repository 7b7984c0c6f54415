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

Fault = Literal["none", "freeze", "time_out", "disconnect", "nan", "stuck", "lie"]


class FaultyInterferometer:
    """Reads as `sim-interferometer` does, up to the recording in which the fault strikes.

    freeze: never returns. time_out, disconnect: an error, at reading or at connecting. nan: no
    number. stuck: the same number for ever. lie: off by `off`.
    """

    class Settings(Interferometer.Settings):
        """Settings of the instrument, and of its fault."""

        fault: Fault = "none"
        in_recording: int = Field(default=1, ge=1, description="From which recording on.")
        motions: int | None = Field(
            default=None, ge=1, description="How many motions it lasts; for ever by default."
        )
        off: Length = Field(default=1e-6, description="For `lie`.")

    unit = "m"

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._sound = Interferometer(settings, context)
        self.samplings = self._sound.samplings
        self._name = context.name
        self._strikes = False
        self._struck = 0

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
        fault = self._settings.fault if self._strikes else "none"
        if fault == "freeze":
            while True:
                time.sleep(1)
        if fault == "time_out":
            raise DeviceError(f"{self._name} timed out after 1 s; check its cable")
        return Reading(_spoilt(fault, reading.value, self._settings.off), reading.time)


def _spoilt(fault: Fault, value: FloatArray, off: float) -> FloatArray:
    if fault == "nan":
        return np.full_like(value, np.nan)
    if fault == "stuck":
        return np.zeros_like(value)
    return np.asarray(value + off if fault == "lie" else value)
