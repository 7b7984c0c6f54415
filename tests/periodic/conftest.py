import numpy as np
import pytest

from labdrive.model.motion import Direction
from labdrive.model.recording import Recording, Sampling

TURN = 2 * np.pi


@pytest.fixture(scope="session")
def recording_of():
    """Make a recording of positions at phases; triggered if the phases are those of a motion."""

    def make(phase, position, samples_per_period, *, time=None, sampling=Sampling.TRIGGERED):
        periods = round(abs(phase[-1] - phase[0]) / TURN)
        forward = phase[-1] >= phase[0]
        return Recording(
            number=1,
            label="walk",
            phase=phase,
            time=np.arange(len(phase)) * 1e-3 if time is None else time,
            readings={"ruler": position},
            units={"ruler": "m"},
            samples_per_period=samples_per_period,
            periods=periods,
            direction=Direction.FORWARD if forward else Direction.BACKWARD,
            sampling=sampling,
        )

    return make


@pytest.fixture(scope="session")
def grid():
    """Phases of a triggered motion [rad]."""

    def make(samples_per_period, periods, start=0.0, sign=1):
        numbers = np.arange(samples_per_period * periods + 1)
        return start + sign * TURN * numbers / samples_per_period

    return make


@pytest.fixture(scope="session")
def position_at():
    """Evaluate step * phase / 2 pi + sum Re(C_k exp(i k phase)) + offset."""

    def evaluate(phase, step, harmonics, offset=0.0):
        orders = np.arange(1, len(harmonics) + 1)
        waves = np.real(np.exp(1j * np.outer(phase, orders)) @ np.asarray(harmonics))
        return offset + step * phase / TURN + waves

    return evaluate
