"""How long an estimate takes, against numpy.sum over the same positions."""

import argparse
import time
from collections.abc import Callable

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN
from labdrive.periodic.estimate import estimate

REPEATS = 5


def walk(samples: int, samples_per_period: int) -> Recording:
    """Return a recording of 5 um steps with a first harmonic and noise, made in place."""
    phase = np.arange(samples + 1, dtype=np.float64)
    phase *= TURN / samples_per_period
    position = np.random.default_rng(0).normal(scale=1e-9, size=samples + 1)
    position[:-1].reshape(-1, samples_per_period)[:] += 1e-7 * np.cos(phase[:samples_per_period])
    position += 5e-6 / TURN * phase
    periods = samples // samples_per_period
    return Recording(
        1, "walk", phase, phase, {"x": position}, {"x": "m"}, samples_per_period, periods
    )


def fastest(call: Callable[[], object]) -> float:
    """Return the shortest of several times [s]: the one least disturbed."""
    return min(_timed(call) for _ in range(REPEATS))


def _timed(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _compare(samples: int, samples_per_period: int) -> None:
    samples -= samples % samples_per_period
    recording = walk(samples, samples_per_period)
    position: FloatArray = recording.readings["x"]
    reference = fastest(position.sum)
    taken = fastest(lambda: estimate(recording, "x", "exact"))
    print(
        f"m = {samples_per_period:5d}: numpy.sum {reference * 1e3:8.2f} ms, "
        f"estimate {taken * 1e3:8.2f} ms, ratio {taken / reference:.2f}"
    )


def main() -> None:
    """Print one line for each number of samples per period."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=100_000_000)
    parser.add_argument("--samples-per-period", type=int, nargs="+", default=[16, 64, 256, 4096])
    options = parser.parse_args()
    for samples_per_period in options.samples_per_period:
        _compare(options.samples, samples_per_period)


if __name__ == "__main__":
    main()
