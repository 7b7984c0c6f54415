"""Phase maps: corrected phase against commanded phase."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN

NODES = 16384


@dataclass(frozen=True, eq=False)
class PhaseMap:
    """A strictly increasing psi(phi) with psi(phi + 2 pi) = psi(phi) + 2 pi.

    `nodes` [rad], shape (length,), are psi at phases 2 pi j / length; between them psi is linear.
    Straight pieces can neither overshoot nor turn back, invert into straight pieces, and are off
    by h^2 psi'' / 8 at most: 1e-7 rad for 0.013 rad at 20 per cycle and 16384 nodes. A waveform
    table whose length divides that of the map is sampled at nodes, so sees no error at all.

    ValueError if the nodes do not rise strictly, the step into the next cycle included.
    """

    nodes: FloatArray

    def __post_init__(self) -> None:
        # A NaN compares false with everything, so it is caught here as well.
        if not np.all(np.diff(np.append(self.nodes, self.nodes[0] + TURN)) > 0):
            raise ValueError("a phase map must rise strictly over the whole cycle")

    @classmethod
    def identity(cls, length: int = NODES) -> Self:
        """Return psi(phi) = phi."""
        return cls(node_phases(length))

    @property
    def length(self) -> int:
        """Number of nodes in a cycle."""
        return len(self.nodes)

    @cached_property
    def deviation(self) -> FloatArray:
        """Return psi(phi) - phi at the nodes [rad], shape (length,)."""
        return np.asarray(self.nodes - node_phases(self.length))

    def __call__(self, phase: FloatArray) -> FloatArray:
        """Return psi(phase) [rad]; phase of any shape."""
        turns = np.asarray(phase) / TURN
        inside = (turns - np.floor(turns)) * self.length
        closed = np.append(self.deviation, self.deviation[0])
        return np.asarray(phase + np.interp(inside, np.arange(self.length + 1), closed))

    def after(self, inner: "PhaseMap") -> "PhaseMap":
        """Return the composition self(inner(phi)), on the nodes of `inner`."""
        return PhaseMap(self(inner.nodes))

    def inverse(self) -> "PhaseMap":
        """Return the map that undoes this one, exact at its nodes."""
        phases = node_phases(self.length)
        # Two more cycles reach every phase, wherever psi(0) lies within a turn of 0.
        shift = TURN * np.floor(self.nodes[0] / TURN)
        outputs = np.concatenate([self.nodes - shift + TURN * cycle for cycle in (-1, 0, 1)])
        inputs = np.concatenate([phases - shift + TURN * cycle for cycle in (-1, 0, 1)])
        return PhaseMap(np.asarray(np.interp(phases, outputs, inputs)))


def node_phases(length: int) -> FloatArray:
    """Return phases 2 pi j / length, j < length [rad]."""
    return np.asarray(np.arange(length) * (TURN / length))
