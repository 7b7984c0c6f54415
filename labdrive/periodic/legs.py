"""Legs of a walking drive: the linear model of a tip, and the waveforms made with it."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.periodic.phase_map import node_phases
from labdrive.periodic.trajectories import TRAJECTORIES, Tip

TABLE_LENGTH = 4096
# So little less than the whole range that rounding cannot take a voltage past a limit.
HAIR = 1e-12


@dataclass(frozen=True)
class LegModel:
    """Tip of a leg [m] against the voltages [V] of its two elements (paper, equation 1).

    x = m11 U0 + m12 U1 along the travel, y = m21 U0 + m22 U1 towards the rod; all in m/V.
    InputError if the matrix has no inverse: some tip positions are then out of reach.
    """

    m11: float
    m12: float
    m21: float
    m22: float

    def __post_init__(self) -> None:
        if not self.determinant:
            raise InputError(f"the leg model cannot be inverted: its determinant is 0 ({self})")

    @classmethod
    def bending(cls, x_per_volt: float, y_per_volt: float) -> Self:
        """Return the model of a bending leg: equal elements pull x apart and push y together."""
        return cls(x_per_volt, -x_per_volt, y_per_volt, y_per_volt)

    @property
    def determinant(self) -> float:
        """Determinant of the matrix [m^2/V^2]."""
        return self.m11 * self.m22 - self.m12 * self.m21

    @property
    def strokes(self) -> tuple[float, float]:
        """Tip along x and along y for a volt, both elements taken together [m/V]."""
        return math.hypot(self.m11, self.m12), math.hypot(self.m21, self.m22)

    def tip(self, U0: FloatArray, U1: FloatArray) -> Tip:
        """Return (x, y) [m] at the voltages [V], any shape."""
        return self.m11 * U0 + self.m12 * U1, self.m21 * U0 + self.m22 * U1

    def voltages(self, x: FloatArray, y: FloatArray) -> Tip:
        """Return (U0, U1) [V] that bring the tip to (x, y) [m], any shape."""
        U0 = (self.m22 * x - self.m12 * y) / self.determinant
        U1 = (self.m11 * y - self.m21 * x) / self.determinant
        return U0, U1

    def sinusoids(self, phase: FloatArray) -> Tip:
        """Return (U0, U1) of unit amplitude, 90 degrees apart: the tip runs on an ellipse.

        It stands highest at phase 0, moving towards +x, as the other trajectories do.
        """
        sense = math.copysign(1, self.determinant)
        lag = math.atan2(sense * self.m22, self.m21)
        return np.cos(phase - lag), -sense * np.sin(phase - lag)


def walking_table(  # noqa: PLR0913 - a recipe's waveform section, spelt out
    trajectory: str,
    legs: LegModel,
    voltage_min: float,
    voltage_max: float,
    peak_to_peak: float | None = None,
    x_scale: float = 1,
    y_scale: float = 1,
    length: int = TABLE_LENGTH,
) -> WaveformTable:
    """Return the waveform of two groups of legs, B half a cycle after A: channels U0 to U3 [V].

    `trajectory` is `ellipse`, `triangle` or `box` (waveforms 1, 2, 3 of the paper). Triangle and
    box take x/x_0 and y as printed (y peaks at 1 and at 2), each in terms of the stroke that a
    volt gives along its axis, and both are scaled together until the larger voltage swings by
    `peak_to_peak`, or by the whole range where that is None: only so does waveform 2 step
    furthest and stall first, as measured in the paper; with equal y strokes it does not.
    The ellipse has voltages of equal amplitude, 90 degrees apart.

    `x_scale` and `y_scale` then shrink the strokes of the tip. Voltages swing about the middle of
    [`voltage_min`, `voltage_min` + `peak_to_peak`], whatever the scales.
    InputError for an unknown trajectory or a swing that does not fit the range.
    """
    swing = _checked_swing(voltage_min, voltage_max, peak_to_peak)
    phase = node_phases(length)
    leg = np.array(_leg_voltages(trajectory, legs, phase))
    other = np.array(_leg_voltages(trajectory, legs, phase + np.pi))
    factor = swing * (1 - HAIR) / max(np.ptp(leg, axis=1))
    channels = []
    for group, shape in ((0, leg), (1, other)):
        x, y = legs.tip(*(factor * shape))
        scaled = legs.voltages(x_scale * x, y_scale * y)
        for number, voltage in enumerate(scaled, start=2 * group):
            centred = voltage - (voltage.max() + voltage.min()) / 2 + voltage_min + swing / 2
            channels.append(Channel(f"U{number}", "V", centred, group_phase=group * math.pi))
    return WaveformTable(tuple(channels))


def predicted_step(table: WaveformTable, legs: LegModel) -> float:
    """Return the step of a rod that always goes with the higher group [m].

    The travel of the tip of group A (U0, U1) while it stands higher than that of B (U2, U3), plus
    that of B for the rest of the cycle; no load, no give, equal groups.
    """
    U = [np.append(channel.samples, channel.samples[0]) for channel in table.channels]
    (x_a, y_a), (x_b, y_b) = legs.tip(U[0], U[1]), legs.tip(U[2], U[3])
    lead = y_a - y_b
    total = np.abs(lead[:-1]) + np.abs(lead[1:])
    raised = np.maximum(lead[:-1], 0) + np.maximum(lead[1:], 0)
    share = np.divide(raised, total, out=np.full_like(total, 0.5), where=total > 0)
    return float(np.sum(share * np.diff(x_a) + (1 - share) * np.diff(x_b)))


def _leg_voltages(trajectory: str, legs: LegModel, phase: FloatArray) -> Tip:
    """Return (U0, U1) of a leg, in any scale."""
    if trajectory == "ellipse":
        return legs.sinusoids(phase)
    if trajectory not in TRAJECTORIES:
        known = ", ".join(["ellipse", *TRAJECTORIES])
        raise InputError(
            Problem(f"no such trajectory; there are {known}", "waveform.trajectory", got=trajectory)
        )
    x, y = TRAJECTORIES[trajectory](phase)
    x_stroke, y_stroke = legs.strokes
    return legs.voltages(x_stroke * x, y_stroke * y)


def _checked_swing(voltage_min: float, voltage_max: float, peak_to_peak: float | None) -> float:
    """Return the largest peak-to-peak voltage wanted; InputError if it does not fit the range."""
    room = voltage_max - voltage_min
    swing = room if peak_to_peak is None else peak_to_peak
    if not 0 < swing <= room:
        message = f"must be above 0 V and fit the voltage range of {room:g} V"
        raise InputError(Problem(message, "waveform.amplitude", got=f"{swing:g} V"))
    return swing
