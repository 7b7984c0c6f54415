"""Trajectories: the path of a leg's tip over the phase, group A carrying for |phi| < pi/2.

The formulas are those of Hasselmann et al., "Elimination of periodic nonlinearities of actuators
with internal periodic processes", Methods: waveform 2 (`triangle`) and 3 (`box`). Waveform 1, the
ellipse, is made of plain sinusoids of voltage, so its strokes are those of the leg: see `legs`.
"""

from collections.abc import Callable, Mapping

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN

Tip = tuple[FloatArray, FloatArray]


def triangle(phase: FloatArray) -> Tip:
    """Return (x / x_0, y) of the rounded triangle; phase [rad] of any shape."""
    return _lateral(phase), _lift(phase)


def box(phase: FloatArray) -> Tip:
    """Return (x / x_0, y) of the box with rounded edges; phase [rad] of any shape.

    The half stands outside the square, as printed, so y peaks at 2 where the triangle's is 1.
    """
    return _lateral(phase), 2 * _lift(phase) ** 2


TRAJECTORIES: Mapping[str, Callable[[FloatArray], Tip]] = {"triangle": triangle, "box": box}


def _lateral(phase: FloatArray) -> FloatArray:
    """Return x / x_0: straight while carrying, then back on a cubic; between -1 and 1."""
    carrying = _wrapped(phase, -np.pi / 2)
    back = carrying - np.pi
    path = np.where(back <= -np.pi / 2, carrying, 4 / np.pi**2 * back**3 - 2 * back)
    return np.asarray(3 * np.sqrt(6) / (4 * np.pi) * path)


def _lift(phase: FloatArray) -> FloatArray:
    """Return the y of the triangle, between 0 and 1."""
    return np.asarray((1 + np.cos(_wrapped(phase, -np.pi) ** 2 / np.pi)) / 2)


def _wrapped(phase: FloatArray, lowest: float) -> FloatArray:
    """Return the phase, less whole turns, in [lowest, lowest + 2 pi[."""
    return np.asarray(lowest + np.mod(phase - lowest, TURN))
