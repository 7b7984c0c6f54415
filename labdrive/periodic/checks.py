"""What every estimate asks of a recording first."""

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.recording import Recording


def readings_of(recording: Recording, sensor: str) -> FloatArray:
    """Return what `sensor` read; EstimationError naming the sensors there are."""
    if sensor not in recording.readings:
        known = ", ".join(recording.readings) or "none"
        raise EstimationError(f"{recording.label}: no sensor {sensor!r}; the recording has {known}")
    return recording.readings[sensor]


def not_finite(recording: Recording, values: FloatArray, name: str) -> EstimationError:
    """Return the error that names the first of `values` that is not a finite number."""
    first = int(np.argmin(np.isfinite(values)))
    return EstimationError(
        f"{recording.label}: {name} holds {values[first]} at sample {first}; "
        "leave such samples out (estimator least_squares needs no gapless recording)"
    )
