"""A recording: what the sensors read over a motion, with the phase and time of each sample."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Direction


class Sampling(StrEnum):
    """How samples came about.

    `triggered`: the actuator's clock latched every sensor at equidistant phases.
    `polled`: each sample has its own time and a phase that follows from the motion.
    """

    TRIGGERED = "triggered"
    POLLED = "polled"


@dataclass(frozen=True, eq=False)
class Recording:
    """Sensor readings over the phase.

    `phase` [rad], `time` [s] and each of `readings` [SI, see `units`] have shape (samples,).
    `number` counts a run's recordings from 1.
    """

    number: int
    label: str
    phase: FloatArray
    time: FloatArray
    readings: Mapping[str, FloatArray]
    units: Mapping[str, str]
    samples_per_period: int
    periods: int
    direction: Direction = Direction.FORWARD
    sampling: Sampling = Sampling.TRIGGERED
