"""The optimizer `fourier` through its interface, on plants that are plain functions."""

import numpy as np
import pytest

from labdrive.model.errors import InputError, NonMonotonicError
from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive_optimizers.fourier import FourierOptimizer

M, PERIODS, LENGTH = 64, 4, 4096


def table(groups=1):
    """Return angles of `groups` groups, the second half a cycle on."""
    phase = TURN * np.arange(LENGTH) / LENGTH
    return WaveformTable(
        tuple(
            Channel(f"angle{i}", "rad", phase + np.pi * i, TURN, np.pi * i) for i in range(groups)
        )
    )


def optimizer(nominal, **settings):
    return FourierOptimizer(FourierOptimizer.Settings(**settings), nominal)


def recorded(proposal, plant):
    """Return what a sensor reads of `plant`, a function of the channels' outputs."""
    phase = TURN * np.arange(PERIODS * M + 1) / M
    position = plant(*(channel.at(phase) for channel in proposal.table.channels))
    return Recording(1, "test", phase, phase, {"x": position}, {"x": "m"}, M, PERIODS)


def rms_after(optimizer, plant, updates):
    tried = optimizer.first()
    for _ in range(updates):
        tried = optimizer.next(tried, optimizer.estimate(recorded(tried, plant), "x"))
    return optimizer.estimate(recorded(tried, plant), "x").periodic_error.rms


def screw(theta):
    return theta / TURN + 0.02 * np.sin(theta + 0.3) + 0.005 * np.cos(3 * theta)


def pair(a, b):
    """Two groups that each carry the load half of the time and are not alike."""
    return (a + b - np.pi) / 2 / TURN + 0.01 * np.sin(2 * a) + 0.004 * np.sin(a)


def test_one_update_straightens_a_memoryless_plant():
    assert rms_after(optimizer(table()), screw, 0) > 0.01
    assert rms_after(optimizer(table()), screw, 1) < 1e-7


def test_the_printed_estimator_needs_more_updates_than_the_exact_one():
    exact = rms_after(optimizer(table(), harmonics=7), screw, 1)
    printed = rms_after(optimizer(table(), harmonics=7, estimator="paper"), screw, 1)
    assert printed > 3 * exact


def test_shared_phase_corrects_odd_harmonics_and_symmetric_leaves_them():
    nominal = table(2)
    assert rms_after(optimizer(nominal), pair, 2) < 1e-6
    left = rms_after(optimizer(nominal, groups="symmetric"), pair, 2)
    assert left == pytest.approx(0.004 / 2**0.5, rel=0.1)


def test_symmetric_maps_repeat_every_half_cycle():
    symmetric = optimizer(table(2), groups="symmetric")
    first = symmetric.first()
    proposal = symmetric.next(first, symmetric.estimate(recorded(first, pair), "x"))
    bent = proposal.phase_map.deviation
    np.testing.assert_allclose(bent, np.roll(bent, len(bent) // 2), atol=1e-9)


@pytest.mark.parametrize("groups", ["symmetric", "shared_table"])
def test_a_single_group_has_one_way_only(groups):
    with pytest.raises(InputError, match="single group"):
        optimizer(table(), groups=groups)


def backwards(theta):
    return theta / TURN + 0.2 * np.sin(theta)


def test_a_response_that_runs_backwards_is_an_error_or_limited_with_a_remark():
    strict = optimizer(table())
    response = strict.estimate(recorded(strict.first(), backwards), "x")
    with pytest.raises(NonMonotonicError, match="deg"):
        strict.next(strict.first(), response)
    limited = optimizer(table(), on_nonmonotonic="limit")
    proposal = limited.next(limited.first(), response)
    assert proposal.remark.startswith("limited over ")
    assert np.all(np.diff(proposal.phase_map.nodes) > 0)
    assert rms_after(limited, backwards, 1) < 0.3 * rms_after(limited, backwards, 0)


def test_a_plain_update_has_nothing_to_remark():
    plain = optimizer(table())
    response = plain.estimate(recorded(plain.first(), screw), "x")
    assert plain.next(plain.first(), response).remark == ""
