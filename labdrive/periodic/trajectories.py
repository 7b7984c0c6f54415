"""Trajectories: the path of a leg's tip over the phase, group A carrying for |phi| < pi/2.

The formulas are those of Hasselmann et al., "Elimination of periodic nonlinearities of actuators
with internal periodic processes", Methods: waveform 1 (`ellipse`), 2 (`triangle`), 3 (`box`).
"""

from collections.abc import Callable, Mapping

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN

Tip = tuple[FloatArray, FloatArray]

Trajectory = Callable[[FloatArray], Tip]
"""A pure function of the phase [rad, any shape]: (x, y) of group A's tip, in any scale.

x is along the travel, y towards the rod; x rises and y is high while the group carries.
"""


def ellipse(phase: FloatArray) -> Tip:
    """Return (x / x_0, y) of the ellipse; phase [rad] of any shape.

    Elements at right angles to one another, as those of a bending leg are, get voltages of equal
    amplitude a quarter of a cycle apart.
    """
    return np.sin(phase), np.cos(phase)


def triangle(phase: FloatArray) -> Tip:
    """Return (x / x_0, y) of the rounded triangle; phase [rad] of any shape."""
    return _lateral(phase), _lift(phase)


def box(phase: FloatArray) -> Tip:
    """Return (x / x_0, y) of the box with rounded edges; phase [rad] of any shape.

    The half stands outside the square, as printed, so y peaks at 2 where the triangle's is 1.
    """
    return _lateral(phase), 2 * _lift(phase) ** 2


TRAJECTORIES: Mapping[str, Trajectory] = {"ellipse": ellipse, "triangle": triangle, "box": box}


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
