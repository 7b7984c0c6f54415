"""Hysteresis of piezo elements: plays side by side (Prandtl-Ishlinskii), fitted and inverted.

The inverse of such an operator is one of its kind; its radii and weights are those of K. Kuhnen,
"Modeling, identification and compensation of complex hysteretic nonlinearities: a modified
Prandtl-Ishlinskii approach", European Journal of Control 9 (2003).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError


@dataclass(frozen=True, eq=False)
class PlayModel:
    """Output = gain U + sum of weights play_radius(U); radii [V] rising from above 0.

    InputError for weights that would let the output fall while the voltage rises: such a model has
    no inverse.
    """

    radii: FloatArray
    weights: FloatArray
    gain: float = 1.0

    def __post_init__(self) -> None:
        if len(self.radii) != len(self.weights) or np.any(np.diff(self.radii) <= 0):
            raise InputError("hysteresis: radii must rise, and there must be a weight for each")
        if self.gain <= 0 or np.any(self.gain + np.cumsum(self.weights) <= 0):
            raise InputError("hysteresis: these weights let the output fall as the voltage rises")

    def steady(self, U: FloatArray) -> FloatArray:
        """Return the output [V] over a cycle of `U` [V], shape (length,), repeated for ever."""
        return np.asarray(self.gain * U + steady_plays(U, self.radii) @ self.weights)

    def inverse(self) -> "PlayModel":
        """Return the model that undoes this one."""
        slopes = self.gain + np.concatenate([[0.0], np.cumsum(self.weights)])
        lags = [
            self.gain * radius + np.sum(self.weights[:i] * (radius - self.radii[:i]))
            for i, radius in enumerate(self.radii)
        ]
        weights = -self.weights / (slopes[1:] * slopes[:-1])
        return PlayModel(np.array(lags), weights, 1 / self.gain)

    def swing(self, swing: float) -> float:
        """Return how far the output swings [V] while the voltage swings by `swing` [V]."""
        dragged = np.maximum(swing - 2 * self.radii, 0.0)
        return self.gain * swing + float(dragged @ self.weights)

    def compensated(self, U: FloatArray) -> FloatArray:
        """Return voltages whose output follows the shape of `U`, between the same extremes.

        `U` [V], shape (length,), is one cycle of many. Between those extremes the output swings by
        `swing`, so that is what the inverse is asked for.
        """
        swing = float(np.ptp(U))
        if swing == 0:
            return U
        V = self.inverse().steady(self.swing(swing) / swing * U)
        return np.asarray(V - V.min() + U.min())


def steady_plays(U: FloatArray, radii: FloatArray | Sequence[float]) -> FloatArray:
    """Return each play operator over a cycle repeated for ever, shape (length, radii).

    play_r stays while U moves within r to either side of it and is dragged along beyond.
    """
    radii = np.asarray(radii, dtype=np.float64)
    play = np.clip(np.zeros_like(radii), U[0] - radii, U[0] + radii)
    # One cycle forgets where a play began: it has been dragged by the extremes, or never moves.
    for u in U:
        play = np.clip(play, u - radii, u + radii)
    plays = np.empty((len(U), len(radii)))
    for i, u in enumerate(U):
        play = np.clip(play, u - radii, u + radii)
        plays[i] = play
    return plays
