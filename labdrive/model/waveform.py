"""Waveform tables: what an actuator plays over one cycle."""

import math
from dataclasses import dataclass, replace

import numpy as np

from labdrive.model.arrays import FloatArray

TURN = 2 * math.pi


@dataclass(frozen=True, eq=False)
class Channel:
    """One output over one cycle.

    `samples`, shape (length,), are at phases 2 pi j / length. `advance` is what the output gains
    in a cycle (0 for a voltage, 2 pi for a spindle's angle). `group_phase` [rad] is the phase by
    which the channel's group leads the first group: pi for the second pair of legs of a walking
    drive, whose nominal samples are the first pair's half a cycle on.
    """

    name: str
    unit: str
    samples: FloatArray
    advance: float = 0.0
    group_phase: float = 0.0

    def at(self, phase: FloatArray) -> FloatArray:
        """Return the output at each phase [rad], interpolated linearly; any shape."""
        length = len(self.samples)
        turns = phase / TURN
        cycle = np.floor(turns)
        nodes = np.append(self.samples, self.samples[0] + self.advance)
        inside = np.interp((turns - cycle) * length, np.arange(length + 1), nodes)
        return np.asarray(inside + self.advance * cycle, dtype=np.float64)

    def steepest(self) -> float:
        """Return the largest change between neighbouring samples times their number [unit/cycle].

        Divided by the duration of a cycle this is the slew the table asks for.
        """
        nodes = np.append(self.samples, self.samples[0] + self.advance)
        return float(np.max(np.abs(np.diff(nodes)))) * len(self.samples)


@dataclass(frozen=True, eq=False)
class WaveformTable:
    """The sampled waveform of one cycle that a generator plays, channel by channel."""

    channels: tuple[Channel, ...]

    @property
    def length(self) -> int:
        """Samples in one cycle."""
        return len(self.channels[0].samples)

    @property
    def group_phases(self) -> tuple[float, ...]:
        """The distinct group phases [rad], ascending."""
        return tuple(sorted({channel.group_phase for channel in self.channels}))

    def channel(self, name: str) -> Channel:
        """Return the channel of that name; KeyError if there is none."""
        return {channel.name: channel for channel in self.channels}[name]

    def with_samples(self, samples: tuple[FloatArray, ...]) -> "WaveformTable":
        """Return the same channels with other samples, one array a channel."""
        pairs = zip(self.channels, samples, strict=True)
        return WaveformTable(tuple(replace(channel, samples=new) for channel, new in pairs))
