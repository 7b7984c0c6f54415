"""Travel the other way: the mirror of a waveform table, and where to go on in it.

A corrected table is linear in the direction it was measured in. In a mirror, legs that swing
forward swing back: for legs that are alike to the left and to the right, the table with the two
elements of each leg swapped, and the phase running the other way, walks as straight backwards
(paper, "Changing the direction of travel").
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.phase_map import PhaseMap


def swapped(table: WaveformTable) -> WaveformTable:
    """Return the mirror of a table of legs: each group's channels swapped, the phase inverted.

    The entry at phase -phi is the other channel's at phi. Played with the phase falling, the legs
    do what they do in `table` with the phase rising, left and right exchanged.
    """
    inverted = -np.arange(table.length) % table.length
    channels = []
    for lead in table.group_phases:
        group = [channel for channel in table.channels if channel.group_phase == lead]
        for channel, other in zip(group, reversed(group), strict=True):
            channels.append(replace(channel, samples=other.samples[inverted]))
    return WaveformTable(tuple(channels))


def switch_phase(psi: PhaseMap, phase: FloatArray) -> FloatArray:
    """Return where to go on in the swapped table so that both groups keep their places [rad].

    A waveform that is its own mirror, U(theta) = swap U(-theta) as those of the paper, is played
    forward at theta = psi(phase). The swapped table has the same tips where -psi(-phi) = theta, so
    at phi = -psi^-1(-psi(phase)): at `phase` itself only where psi is odd.
    """
    return -psi.inverse()(-psi(phase))


def switch_jump(
    forward: Mapping[str, FloatArray], reverse: Mapping[str, FloatArray], psi: PhaseMap
) -> float:
    """Return the furthest that any tip jumps [m] if tables are switched at any phase.

    `forward` and `reverse` are the tips of both tables, as `HasLegs.tips` gives them.
    """
    length = len(next(iter(forward.values())))
    phase = 2 * np.pi * np.arange(length) / length
    place = np.mod(switch_phase(psi, phase) / (2 * np.pi), 1) * length
    jumps = [
        np.interp(place, np.arange(length + 1), np.append(reverse[name], reverse[name][0])) - tip
        for name, tip in forward.items()
    ]
    return float(np.max(np.abs(jumps)))
