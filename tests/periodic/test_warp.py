import numpy as np
import pytest

from labdrive.model.waveform import Channel, WaveformTable
from labdrive.periodic.legs import LegModel, walking_table
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.trajectories import box
from labdrive.periodic.warp import warp

TURN = 2 * np.pi
TABLE = walking_table(box, LegModel.bending(0.036e-6, 0.025e-6), 0, 48, length=4096)
PHASE = node_phases(4096)


def volts(table):
    return np.array([channel.samples for channel in table.channels])


def half_period_map():
    nodes = node_phases(16384)
    return PhaseMap(nodes + 0.2 * (np.sin(2 * nodes + 1) - np.sin(1)))


def lopsided_map():
    nodes = node_phases(16384)
    return PhaseMap(nodes + 0.3 * np.sin(nodes))


@pytest.mark.parametrize("groups", ["shared_phase", "shared_table"])
def test_the_identity_changes_nothing(groups):
    np.testing.assert_allclose(
        volts(warp(TABLE, PhaseMap.identity(), groups)), volts(TABLE), atol=1e-10
    )


def test_shared_phase_plays_every_channel_at_the_corrected_phase():
    psi = lopsided_map()
    warped = warp(TABLE, psi, "shared_phase")
    for old, new in zip(TABLE.channels, warped.channels, strict=True):
        np.testing.assert_allclose(new.samples, old.at(psi(PHASE)), atol=1e-12)
        assert (new.name, new.unit, new.group_phase) == (old.name, old.unit, old.group_phase)


def test_shared_table_gives_the_second_group_the_first_ones_samples_half_a_cycle_on():
    U = volts(warp(TABLE, lopsided_map(), "shared_table"))
    np.testing.assert_allclose(U[2:], np.roll(U[:2], -2048, axis=1), atol=1e-10)
    assert np.abs(U[:2] - volts(warp(TABLE, lopsided_map(), "shared_phase"))[:2]).max() < 1e-12


def test_a_half_period_map_is_the_same_to_both():
    both = [volts(warp(TABLE, half_period_map(), g)) for g in ("shared_phase", "shared_table")]
    np.testing.assert_allclose(both[0], both[1], atol=1e-9)


def test_warping_an_angle_is_adding_the_deviation():
    angle = WaveformTable((Channel("angle", "rad", PHASE, advance=TURN),))
    warped = warp(angle, lopsided_map(), "shared_phase")
    assert warped.length == 4096
    np.testing.assert_allclose(warped.channels[0].samples, PHASE + 0.3 * np.sin(PHASE), atol=1e-12)
