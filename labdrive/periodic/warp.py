"""Warping: the table that plays a nominal waveform at a corrected phase."""

from typing import Literal

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.periodic.phase_map import PhaseMap, node_phases

Groups = Literal["shared_phase", "shared_table"]


def warp(table: WaveformTable, psi: PhaseMap, groups: Groups) -> WaveformTable:
    """Return the table played at psi(phi), of the same length.

    `shared_phase`: every channel follows psi, so each group re-times its own half of the step.
    `shared_table`: every group plays the first one's corrected waveform, later by its own phase:
    a channel of group phase d is played at psi(phi + d) - d.
    """
    phase = node_phases(table.length)
    return table.with_samples(tuple(_played(c, psi, phase, groups) for c in table.channels))


def _played(channel: Channel, psi: PhaseMap, phase: FloatArray, groups: Groups) -> FloatArray:
    """Return the samples of a channel at the corrected phases."""
    lead = channel.group_phase if groups == "shared_table" else 0.0
    return channel.at(psi(phase + lead) - lead)
