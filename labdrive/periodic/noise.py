"""Noise of a recording: white and random-walk levels, fitted between the harmonics of the cycle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import FloatArray
from labdrive.periodic.fold import fold

# Samples looked at: enough for levels good to a percent, few enough to cost nothing.
NOISE_SAMPLES = 32768
# Bins averaged about a harmonic: its standard error is then good to 9 %.
LOCAL_BINS = 32
LEAST_BINS = 4


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise between the harmonics, of positions that a line was taken from.

    `white` is the variance of a sample. `walk` is what a random walk gains from one sample to the
    next [unit^2], a fifth too much: the line misses its ends, and the jump there leaks into every
    bin. `excess`, shape (K + 1,), is the power found about multiple k = 0..K of the cycle's
    frequency over what the two levels foresee there: it speaks for noise of any other colour.
    """

    white: float
    walk: float
    excess: FloatArray


def equidistant_noise(position: FloatArray, samples_per_period: int, order: int) -> Noise:
    """Return the noise of n m + 1 equidistant positions, from a bounded stretch of whole cycles."""
    m = samples_per_period
    whole = (len(position) - 1) // m
    cycles = min(whole, max(2, NOISE_SAMPLES // m))
    start = (whole - cycles) // 2 * m
    stretch = position[start : start + cycles * m + 1]
    # A line through means over cycles, unlike one through samples, is blind to the harmonics.
    line = fold(stretch, m).step / m * np.arange(cycles * m)
    residual = stretch[:-1] - stretch[0] - line
    return residual_noise(residual, cycles, len(residual), order) or Noise(
        float(np.var(residual)), 0.0, np.ones(order + 1)
    )


def residual_noise(
    cells: FloatArray, cycles: int, samples: int, order: int, drift_order: int = 1
) -> Noise | None:
    """Return the noise of residuals summed into equal cells of phase over whole cycles.

    `cells` hold the sums of `samples` residuals. The harmonics may still be in them; the lowest
    bins, emptied by the drift that was taken out, are left aside. None where too few bins lie
    between the harmonics.
    """
    bins = np.arange(1 + drift_order, min(len(cells) // 2, cycles * (order + 1)))
    bins = bins[bins % cycles != 0]
    if not LEAST_BINS <= len(bins) <= samples:
        return None
    power = np.abs(np.fft.rfft(cells)[bins]) ** 2 / samples
    gain = squared_gain(bins / samples)
    return fit_noise(bins / cycles, power * gain, gain, order)


def squared_gain(frequency: FloatArray) -> FloatArray:
    """Return the squared gain of a difference of neighbouring samples; frequency a sample."""
    return np.asarray(4 * np.sin(np.pi * np.minimum(frequency, 0.5)) ** 2)


def fit_noise(orders: FloatArray, power: FloatArray, gain: FloatArray, order: int) -> Noise:
    """Fit power = white * gain + walk, each bin exponentially distributed (Whittle's likelihood).

    `orders`, shape (bins,), are frequencies in multiples of the cycle's; `power` [unit^2] is that
    of differences of neighbouring samples, `gain` what differencing does to white noise.
    """
    if not power.any():
        return Noise(0.0, 0.0, np.ones(order + 1))
    # With the ratio of the levels given, their scale is a mean: one number is left to search.
    low, high = np.log(1e-10), np.log(1e10)
    for _ in range(6):
        grid = np.linspace(low, high, 9)
        best = int(np.argmin([_misfit(power, gain + np.exp(ratio)) for ratio in grid]))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, 8)]
    ratio = np.exp((low + high) / 2)
    white = float(np.mean(power / (gain + ratio)))
    found = power / (white * (gain + ratio))
    return Noise(white, float(white * ratio), _local_means(orders, found, order))


def _misfit(power: FloatArray, shape: FloatArray) -> float:
    """Return Whittle's negative log-likelihood a bin, at the scale that minimizes it."""
    return float(np.log(np.mean(power / shape)) + np.mean(np.log(shape)))


def _local_means(orders: FloatArray, found: FloatArray, order: int) -> FloatArray:
    """Return the mean of `found` over the bins nearest to each multiple, shape (order + 1,)."""
    count = min(LOCAL_BINS, len(found))
    first: NDArray[np.int64] = np.searchsorted(orders, np.arange(order + 1)) - count // 2
    first = np.clip(first, 0, len(found) - count)
    total = np.append(0, np.cumsum(found))
    return np.asarray((total[first + count] - total[first]) / count)
