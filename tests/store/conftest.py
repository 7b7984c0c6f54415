"""Recordings to keep."""

import numpy as np
import pytest

from labdrive.model.recording import Recording


@pytest.fixture
def make_recording():
    def make(number=1, samples=65, **changes):
        phase = np.linspace(0, 8 * np.pi, samples)
        columns = {
            "phase": phase,
            "time": phase / 7,
            "readings": {"interferometer": np.sin(phase) * 1e-7, "force": np.cos(phase) / 3},
            "units": {"interferometer": "m", "force": "N"},
        }
        shape = {"samples_per_period": 16, "periods": 4}
        return Recording(number=number, label="iteration 0", **{**columns, **shape, **changes})

    return make
