"""What actuators and sensors need of any simulated plant."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from labdrive.model.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Stretch:
    """Where a plant has been over its last steps: `position` [m] at `time` [s], shape (steps,).

    Time counts from the start of the motion. The last step before is kept as the first, so that
    readings between two stretches can be interpolated.
    """

    time: FloatArray
    position: FloatArray

    def at(self, time: FloatArray) -> FloatArray:
        """Return the position [m] at each time [s]; at the time of a step, exactly that step's."""
        return np.asarray(np.interp(time, self.time, self.position))


class Plant(Protocol):
    """A simulated mechanism: it follows outputs step by step and stays where it was left."""

    @property
    def outputs(self) -> FloatArray:
        """The outputs applied last, shape (channels,)."""

    @property
    def stretch(self) -> Stretch:
        """The steps made by the last call of `follow`."""

    @property
    def load(self) -> float:
        """External force against forward travel [N]."""

    def follow(self, outputs: FloatArray, time: FloatArray, step_s: float) -> None:
        """Apply `outputs`, shape (steps, channels), each for `step_s`; `time` [s] names them."""
