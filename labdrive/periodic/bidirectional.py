"""Accuracy and repeatability of positioning, approached from both sides, in the terms of ISO 230-2.

ISO 230-2:2014, section 3 (definitions) and 7 (evaluation); expanded by k = 2, without the
uncertainty of the measurement.
"""

from dataclasses import asdict, dataclass

import numpy as np

from labdrive.model.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Targets:
    """Deviations at each target position, over the runs. All of shape (targets,), one unit.

    `forward`, `backward` are unidirectional mean deviations; `spread_*` the estimators of their
    standard uncertainty, s_i.
    """

    forward: FloatArray
    backward: FloatArray
    spread_forward: FloatArray
    spread_backward: FloatArray

    @property
    def reversal(self) -> FloatArray:
        """Reversal value B_i: forward less backward."""
        return self.forward - self.backward


@dataclass(frozen=True)
class Positioning:
    """The parameters of ISO 230-2, in the unit of the deviations."""

    mean_reversal_value: float
    reversal_value: float
    repeatability_forward: float
    repeatability_backward: float
    repeatability: float
    systematic_deviation_forward: float
    systematic_deviation_backward: float
    systematic_deviation: float
    mean_bidirectional_deviation: float
    accuracy_forward: float
    accuracy_backward: float
    accuracy: float

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name."""
        return asdict(self)


def targets(forward: FloatArray, backward: FloatArray) -> Targets:
    """Return the statistics of deviations of shape (runs, targets), two runs or more."""
    return Targets(
        forward.mean(axis=0),
        backward.mean(axis=0),
        np.asarray(forward.std(axis=0, ddof=1)),
        np.asarray(backward.std(axis=0, ddof=1)),
    )


def positioning(t: Targets) -> Positioning:
    """Return the parameters over all targets."""
    up, down = t.spread_forward, t.spread_backward
    both_means = np.stack([t.forward, t.backward])
    mean = both_means.mean(axis=0)
    bidirectional = np.maximum.reduce([2 * up + 2 * down + np.abs(t.reversal), 4 * up, 4 * down])
    highest = np.maximum(t.forward + 2 * up, t.backward + 2 * down)
    lowest = np.minimum(t.forward - 2 * up, t.backward - 2 * down)
    return Positioning(
        mean_reversal_value=float(t.reversal.mean()),
        reversal_value=float(np.abs(t.reversal).max()),
        repeatability_forward=float((4 * up).max()),
        repeatability_backward=float((4 * down).max()),
        repeatability=float(bidirectional.max()),
        systematic_deviation_forward=float(np.ptp(t.forward)),
        systematic_deviation_backward=float(np.ptp(t.backward)),
        systematic_deviation=float(np.ptp(both_means)),
        mean_bidirectional_deviation=float(np.ptp(mean)),
        accuracy_forward=float((t.forward + 2 * up).max() - (t.forward - 2 * up).min()),
        accuracy_backward=float((t.backward + 2 * down).max() - (t.backward - 2 * down).min()),
        accuracy=float(highest.max() - lowest.min()),
    )
