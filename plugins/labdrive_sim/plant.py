"""What actuators and sensors need of a simulated plant."""

from dataclasses import astuple, dataclass
from typing import Any, Literal, Protocol, Self, cast

import numpy as np

from labdrive.interfaces.devices import DeviceContext
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem

Quantity = Literal["position", "force", "height"]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Where a plant has been, step by step.

    `time` [s] since the motion began, rising; `position` [m]; `force` [N] along the travel that
    drives the moved part; `height` [m] at which it is held across the travel; all of shape
    (steps,).
    """

    time: FloatArray
    position: FloatArray
    force: FloatArray
    height: FloatArray

    @classmethod
    def at_rest(cls) -> Self:
        """Return the stretch of a plant that has never moved."""
        return cls(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1))

    def at(self, quantity: Quantity, time: FloatArray) -> FloatArray:
        """Return a quantity [SI] at some times; at the time of a step exactly that step's."""
        return np.asarray(np.interp(time, self.time, getattr(self, quantity)))

    def then(self, later: "Stretch") -> "Stretch":
        """Return both in a row."""
        pairs = zip(astuple(self), astuple(later), strict=True)
        return Stretch(*(np.append(one, other) for one, other in pairs))

    def end(self) -> "Stretch":
        """Return the last step alone, as of a plant that stands there."""
        return Stretch(*(values[-1:] for values in astuple(self)))


class Plant(Protocol):
    """A simulated mechanism: it follows outputs step by step and stays where it was left."""

    @property
    def outputs(self) -> FloatArray:
        """The outputs applied last, shape (channels,)."""

    @property
    def stretch(self) -> Stretch:
        """The steps made by the last call of `follow`."""

    def follow(self, outputs: FloatArray, time: FloatArray, step_s: float) -> None:
        """Apply `outputs`, shape (steps, channels), each for `step_s`; `time` [s] names them."""


class View:
    """What a sensor sees of a plant during an acquisition.

    Until the plant moves it stands where it was left; its last steps belong to an earlier motion.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._before = plant.stretch
        self._last: Stretch | None = None

    @property
    def stretch(self) -> Stretch:
        """The steps that the plant has just made, or the one it stands on."""
        now = self._plant.stretch
        if now is not self._before:
            return now
        return now.end()

    def recent(self) -> Stretch:
        """Return these steps after those that the last call returned.

        A plant is a few steps ahead of the last sample: what is read there is due next time.
        """
        now, last = self.stretch, self._last
        self._last = now
        return now if last is None else last.then(now)


def plant_of(context: DeviceContext, field: str, link: str, channels: int | None = None) -> Plant:
    """Return the plant that the setting `field` names; InputError if it is none that will do.

    `channels` is how many outputs it has to take, None where that does not matter.
    """
    plant: Any = context.links.get(link)
    taken = len(getattr(plant, "outputs", ()))
    if not hasattr(plant, "stretch") or channels not in {None, taken}:
        due = "" if channels is None else f" that takes {channels} outputs"
        found = [name for name, other in context.links.items() if hasattr(other, "stretch")]
        message = f"must name a simulated plant{due}; the bench has {', '.join(found) or 'none'}"
        raise InputError(Problem(message, field, got=link))
    return cast("Plant", plant)
