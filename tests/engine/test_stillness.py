"""A sensor of position that reads the same on and on: when that is a fault, and when it is not."""

import numpy as np
import pytest

from labdrive.engine.stillness import Stillness
from labdrive.model.errors import DeviceError
from labdrive.model.waveform import TURN

M = 64


def judged(value, chunk=M, phase=None, known=0.0):
    """Judge readings of M samples a cycle; return how many of them it took to find a fault."""
    still = Stillness("encoder", known)
    phase = TURN * np.arange(len(value)) / M if phase is None else phase
    for start in range(0, len(value), chunk):
        try:
            still.add(phase[start : start + chunk], value[start : start + chunk])
        except DeviceError:
            return start + chunk
    return None


def walk(cycles, step=1e-6, count=0.0, noise=0.0):
    """Return what a sensor reads of a walk of so many cycles, in whole counts if it has any."""
    n = np.arange(cycles * M)
    position = step * (n / M + 0.02 * np.sin(TURN * n / M))
    position += noise * np.random.default_rng(1).standard_normal(len(n))
    return np.round(position / count) * count if count else position


def frozen(value, at):
    return np.append(value[:at], np.full(len(value) - at, value[at - 1]))


@pytest.mark.parametrize("chunk", [1, 16, 100, 10_000])
@pytest.mark.parametrize("count", [0.0, 1e-9])
def test_a_reading_that_freezes_is_found_within_a_cycle_and_a_chunk(chunk, count):
    value = frozen(walk(20, count=count), at=5 * M)
    assert judged(value, chunk) <= 6 * M + 1 + chunk


def test_one_that_freezes_in_the_first_cycle_is_found_later():
    assert judged(frozen(walk(20), at=M // 2)) <= 4 * M


def test_one_that_never_moved_is_found_if_it_told_positions_apart_before():
    still = np.zeros(20 * M)
    assert judged(still) is None
    assert judged(still, known=M) <= 2 * M + 1


@pytest.mark.parametrize("chunk", [1, 50, 10_000])
@pytest.mark.parametrize("count", [0.3e-6, 1e-6, 2.7e-6, 40e-6])
@pytest.mark.parametrize("noise", [0.0, 1e-9, 0.1e-6])
def test_a_coarse_encoder_may_show_one_count_for_many_cycles(chunk, count, noise):
    assert judged(walk(80, count=count, noise=noise), chunk) is None


def test_a_few_readings_a_cycle_show_little():
    # A move in one go: a reading each cycle, from a register that is renewed now and then.
    phase = TURN * np.arange(60.0)
    assert judged(np.repeat(np.arange(6.0), 10), 1, phase, known=M) is None


def test_a_drive_that_creeps_under_load_goes_on():
    fine = walk(40, step=0.04e-6, count=20e-9)
    assert judged(fine, known=M) is None
