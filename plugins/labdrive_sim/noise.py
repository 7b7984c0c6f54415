"""Noise of simulated sensors: seeded, so that a recording that is made again is the same."""

import zlib

import numpy as np

from labdrive.interfaces.devices import Acquisition, DeviceContext
from labdrive.model.arrays import FloatArray


def generators(
    context: DeviceContext, acquisition: Acquisition, count: int
) -> list[np.random.Generator]:
    """Return independent generators seeded by run, recording and sensor.

    One for each kind of noise: drawn from one, they would depend on how a recording is chunked.
    """
    name = zlib.crc32(context.name.encode())
    return np.random.default_rng([context.seed, acquisition.number, name]).spawn(count)


class RandomWalk:
    """A random walk in time that goes on from chunk to chunk."""

    def __init__(self, density: float, generator: np.random.Generator) -> None:
        """`density` is the standard deviation after 1 s, in the unit of the reading."""
        self._density = density
        self._generator = generator
        self._time = 0.0
        self._value = 0.0

    def at(self, time: FloatArray) -> FloatArray:
        """Return the walk at rising times [s], none earlier than those asked for before."""
        if len(time) == 0:
            return np.zeros(0)
        gaps = np.diff(time, prepend=self._time)
        increments = self._density * np.sqrt(gaps) * self._generator.standard_normal(len(time))
        values = np.cumsum(np.append(self._value, increments))[1:]
        self._time, self._value = float(time[-1]), float(values[-1])
        return np.asarray(values)
