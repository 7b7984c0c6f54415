"""Noise of a recording: white and random-walk levels, fitted between the harmonics of the cycle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import FloatArray
from labdrive.periodic.fold import fold

# Samples looked at: enough for levels good to a percent, few enough to cost nothing.
NOISE_SAMPLES = 32768
# Bins averaged about a harmonic at least: its standard error is then good to 12 %.
LOCAL_BINS = 16
LEAST_BINS = 4


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise between the harmonics, of positions that a line was taken from.

    `white` is the variance of a sample. `walk` is what a random walk gains from one sample to the
    next [unit^2], a fifth too much: the line misses its ends, and the jump there leaks into every
    bin. `excess`, shape (K + 1,), is the power found about multiple k = 0..K of the cycle's
    frequency over what the two levels foresee there: it speaks for noise of any other colour.
    `bins` is the number of bins behind each.
    """

    white: float
    walk: float
    excess: FloatArray
    bins: float


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
    found = residual_noise(residual, cycles, len(residual), order)
    return found or one_level(float(np.var(residual)), len(residual), order)


def one_level(variance: float, freedom: int, order: int) -> Noise:
    """Return white noise, its variance known from so many degrees of freedom."""
    return Noise(variance, 0.0, np.ones(order + 1), freedom / 2)


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
    white, walk = fit_levels(power * gain, gain)
    if not white:
        return one_level(0.0, samples, order)
    excess = power * gain / (white * gain + walk)
    count = min(max(LOCAL_BINS, cycles - 1), len(bins))
    multiples = np.arange(order + 1) * cycles
    return Noise(white, walk, _local_means(bins, excess, multiples, count), count)


def squared_gain(frequency: FloatArray) -> FloatArray:
    """Return the squared gain of a difference of neighbouring samples; frequency a sample."""
    return np.asarray(4 * np.sin(np.pi * np.minimum(frequency, 0.5)) ** 2)


def fit_levels(power: FloatArray, gain: FloatArray) -> tuple[float, float]:
    """Return (white, walk) of power = white * gain + walk, by Whittle's likelihood.

    `power` [unit^2], shape (bins,), is that of differences of neighbouring samples, each bin
    exponentially distributed; `gain` is what differencing does to white noise.
    """
    if not power.any():
        return 0.0, 0.0
    # With the ratio of the levels given, their scale is a mean: one number is left to search.
    low, high = np.log(1e-10), np.log(1e10)
    for _ in range(6):
        grid = np.linspace(low, high, 9)
        best = int(np.argmin([_misfit(power, gain + np.exp(ratio)) for ratio in grid]))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, 8)]
    ratio = float(np.exp((low + high) / 2))
    white = float(np.mean(power / (gain + ratio)))
    return white, white * ratio


def _misfit(power: FloatArray, shape: FloatArray) -> float:
    """Return Whittle's negative log-likelihood a bin, at the scale that minimizes it."""
    return float(np.log(np.mean(power / shape)) + np.mean(np.log(shape)))


def _local_means(
    bins: NDArray[np.int64], values: FloatArray, about: NDArray[np.int64], count: int
) -> FloatArray:
    """Return means over the `count` values whose bins are nearest to each of `about`."""
    first: NDArray[np.int64] = np.searchsorted(bins, about) - count // 2
    first = np.clip(first, 0, len(values) - count)
    total = np.append(0, np.cumsum(values))
    return np.asarray((total[first + count] - total[first]) / count)
