"""Two groups of legs with something of their own each: a gain, and when they take over."""

from dataclasses import dataclass, replace

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.response import Response, dense_length

HALF = np.pi


@dataclass(frozen=True)
class GroupCorrection:
    """What the groups get besides a phase map.

    `gain` is the stroke of the second group over that of the first; the larger one keeps its
    voltages. `retiming` [rad]: each group is played at theta - retiming sin(theta), theta its own
    corrected phase, so that both still move forward where they change.
    """

    gain: float = 1.0
    retiming: float = 0.0


def corrected(nominal: WaveformTable, psi: PhaseMap, groups: GroupCorrection) -> WaveformTable:
    """Return the table played at psi by both groups, each with its own gain and timing.

    Without gain and retiming it is `warp(nominal, psi, "shared_phase")`.
    """
    theta = psi(node_phases(nominal.length))
    return nominal.with_samples(tuple(_played(c, theta, groups) for c in nominal.channels))


def _played(channel: Channel, theta: FloatArray, groups: GroupCorrection) -> FloatArray:
    own = theta + channel.group_phase
    samples = channel.at(own - groups.retiming * np.sin(own) - channel.group_phase)
    gains = np.array([1.0, groups.gain])
    gain = (gains / gains.max())[int(channel.group_phase != 0)]
    middle = (channel.samples.max() + channel.samples.min()) / 2
    return np.asarray(middle + gain * (samples - middle))


def half_cycle_ratio(response: Response) -> float:
    """Return the travel while the first group carries, |phase| < pi/2, over that of the rest."""
    ends = response.position(np.array([-HALF / 2, HALF / 2]))
    first = float(ends[1] - ends[0])
    return first / (response.step_size - first)


def least_slope(response: Response) -> float:
    """Return the least slope of the response, of its mean: below 0 where it runs backwards."""
    slopes = response.slope_over_cycle(dense_length(response.order))
    return float(np.min(slopes / response.step_size)) * 2 * HALF


def with_gain(groups: GroupCorrection, response: Response) -> GroupCorrection:
    """Return the correction with a gain that should make both half cycles go as far."""
    return replace(groups, gain=groups.gain * half_cycle_ratio(response))
