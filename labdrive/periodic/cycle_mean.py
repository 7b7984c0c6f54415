"""Mean of a reading over whole cycles, with the error that the cycles themselves show."""

import math

import numpy as np

from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN
from labdrive.periodic.measured import Measured


def cycle_mean(recording: Recording, sensor: str) -> Measured:
    """Return the mean of a sensor over the whole cycles of a recording.

    What repeats each cycle does not count as scatter: the error is that of the mean of the cycles'
    means; 0 for a single cycle.
    """
    cycle = np.floor(np.abs(recording.phase - recording.phase[0]) / TURN + 1e-9).astype(int)
    inside = cycle < recording.periods
    count = np.bincount(cycle[inside])
    sums = np.bincount(cycle[inside], weights=recording.readings[sensor][inside])
    means = sums[count > 0] / count[count > 0]
    scatter = float(np.std(means, ddof=1)) if len(means) > 1 else 0.0
    return Measured(float(np.mean(means)), scatter / math.sqrt(len(means)))
