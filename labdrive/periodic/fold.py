"""Folding: an equidistant recording of any length summed over its cycles, in constant memory."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import FloatArray

# A block and its copy stay in a core's cache; a row is long enough for fast sums of short cycles.
BLOCK_SAMPLES = 65536
ROW_SAMPLES = 1024
# Blocks enough that a line through their means is as good as one through those of the cycles.
LEAST_BLOCKS = 64


@dataclass(frozen=True, eq=False)
class Fold:
    """What an estimate needs of n cycles of m positions, and the one position that ends them.

    `sums`, shape (m,), are positions summed over the cycles, up to a common constant; `travel` is
    last position minus first; `step` the slope, by cycle, of a line through means over cycles.
    """

    sums: FloatArray
    cycles: int
    travel: float
    step: float

    @property
    def differences(self) -> FloatArray:
        """Return a_{j+1} - a_j summed over the cycles, shape (m,): the inner terms telescope."""
        closed = np.append(self.sums, self.sums[0] + self.travel)
        return np.diff(closed)


def fold(position: FloatArray, samples_per_period: int) -> Fold:
    """Fold n m + 1 equidistant positions over their n >= 2 cycles of m samples.

    A value that is not finite makes sums or travel so; it costs no pass to look for.
    """
    m = samples_per_period
    cycles = (len(position) - 1) // m
    size = min(max(1, BLOCK_SAMPLES // m), max(1, cycles // LEAST_BLOCKS))
    starts = np.arange(0, cycles, size)
    sums = np.zeros(m)
    means = np.zeros(len(starts))
    with np.errstate(invalid="ignore"):
        for number, start in enumerate(starts.tolist()):
            block = position[start * m : min(start + size, cycles) * m]
            # Far from the origin a sum would lose the digits that matter, so each has its own.
            local = _sum_over_cycles(block - block[0], m)
            means[number] = block[0] - position[0] + local.sum() / len(block)
            sums += local
        travel = float(position[-1]) - float(position[0])
        return Fold(sums, cycles, travel, _slope(starts, means, cycles))


def _sum_over_cycles(block: FloatArray, m: int) -> FloatArray:
    """Return the sum of the block's cycles, shape (m,), several cycles a row where m is small."""
    row = max(1, ROW_SAMPLES // m) * m
    whole = len(block) // row * row
    rows = block[:whole].reshape(-1, row).sum(axis=0)
    rest = block[whole:].reshape(-1, m).sum(axis=0)
    return np.asarray(rows.reshape(-1, m).sum(axis=0) + rest)


def _slope(starts: NDArray[np.int64], means: FloatArray, cycles: int) -> float:
    """Return the slope by cycle of block means, each weighted by its number of cycles."""
    sizes = np.diff(np.append(starts, cycles))
    centres = starts + (sizes - 1) / 2 - (cycles - 1) / 2
    return float(np.sum(sizes * centres * means) / np.sum(sizes * centres**2))
