"""Legs of a walking drive: the linear model of a tip, and the waveforms made with it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.periodic.phase_map import node_phases
from labdrive.periodic.trajectories import Tip, Trajectory

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


def walking_table(  # noqa: PLR0913 - a recipe's waveform section, spelt out
    trajectory: Trajectory,
    legs: LegModel,
    voltage_min: float,
    voltage_max: float,
    peak_to_peak: float | None = None,
    x_scale: float = 1,
    y_scale: float = 1,
    length: int = TABLE_LENGTH,
    *,
    keep_pretension: bool = True,
) -> WaveformTable:
    """Return the waveform of two groups of legs, B half a cycle after A: channels U0 to U3 [V].

    Trajectories are taken as printed (the triangle's y peaks at 1, the box's at 2), x and y each
    in terms of the stroke that a volt gives along its axis, and both are scaled together until the
    larger voltage swings by `peak_to_peak`, or by the whole range where that is None: only so does
    waveform 2 step furthest and stall first, as measured in the paper; with equal y strokes it
    does not.

    Voltages swing about the middle of [`voltage_min`, `voltage_min` + `peak_to_peak`]. `x_scale`
    and `y_scale` then shrink the strokes of the tip. A smaller y stroke about the same middle
    would hold the rod lower, so tense the leaf spring less; with `keep_pretension` the legs are
    raised until the rod is held as high, in the mean, as without scaling.
    InputError for a swing or, after raising, voltages that do not fit the range.
    """
    swing = _checked_swing(voltage_min, voltage_max, peak_to_peak)
    phase = node_phases(length)
    groups = [np.array(_leg_voltages(trajectory, legs, phase + lag)) for lag in (0, np.pi)]
    factor = swing * (1 - HAIR) / max(np.ptp(groups[0], axis=1))
    full = [_centred(factor * shape, voltage_min + swing / 2) for shape in groups]
    scaled = [_scaled(group, legs, x_scale, y_scale) for group in full]
    if keep_pretension and (x_scale, y_scale) != (1, 1):
        rise = _height(full, legs) - _height(scaled, legs)
        scaled = [_raised(group, legs, rise) for group in scaled]
        _refuse_beyond(scaled, voltage_min, voltage_max)
    channels = (
        Channel(f"U{2 * group + i}", "V", voltage, group_phase=group * math.pi)
        for group, voltages in enumerate(scaled)
        for i, voltage in enumerate(voltages)
    )
    return WaveformTable(tuple(channels))


def carried_height(x_y: Mapping[str, FloatArray]) -> float:
    """Return how high the rod is held in the mean of a cycle [m]: by the higher group.

    `x_y` are the tips `y_A` and `y_B` at the entries of a table, by the linear model.
    """
    return float(np.mean(np.maximum(x_y["y_A"], x_y["y_B"])))


def tips(table: WaveformTable, legs: LegModel) -> dict[str, FloatArray]:
    """Return the tips of both groups at the table's entries, by the linear model [m]."""
    U = [channel.samples for channel in table.channels]
    (x_a, y_a), (x_b, y_b) = legs.tip(U[0], U[1]), legs.tip(U[2], U[3])
    return {"x_A": x_a, "y_A": y_a, "x_B": x_b, "y_B": y_b}


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


def _centred(voltages: FloatArray, middle: float) -> FloatArray:
    """Return a group's voltages, shape (2, length), each swinging about `middle`."""
    low, high = voltages.min(axis=1, keepdims=True), voltages.max(axis=1, keepdims=True)
    return np.asarray(voltages - (low + high) / 2 + middle)


def _scaled(voltages: FloatArray, legs: LegModel, x_scale: float, y_scale: float) -> FloatArray:
    """Return a group's voltages with the strokes of its tip scaled about the same middle."""
    middle = (voltages.min(axis=1, keepdims=True) + voltages.max(axis=1, keepdims=True)) / 2
    x, y = legs.tip(*(voltages - middle))
    return _centred(np.array(legs.voltages(x_scale * x, y_scale * y)), float(middle[0, 0]))


def _raised(voltages: FloatArray, legs: LegModel, rise: float) -> FloatArray:
    """Return a group's voltages with its tip higher by `rise` [m]."""
    more = np.array(legs.voltages(np.zeros(1), np.array([rise])))
    return np.asarray(voltages + more)


def _height(groups: Sequence[FloatArray], legs: LegModel) -> float:
    """Return how high two groups hold the rod in the mean [m]."""
    y_a, y_b = (legs.tip(*voltages)[1] for voltages in groups)
    return carried_height({"y_A": y_a, "y_B": y_b})


def _refuse_beyond(groups: Sequence[FloatArray], low: float, high: float) -> None:
    lowest, highest = float(np.min(groups)), float(np.max(groups))
    if lowest < low or highest > high:
        message = (
            f"keeping the pretension takes {lowest:.4g} to {highest:.4g} V, outside the bench's "
            f"{low:g} to {high:g} V; set `pretension: free`, or a smaller amplitude"
        )
        raise InputError(Problem(message, "waveform.y_scale"))


def _leg_voltages(trajectory: Trajectory, legs: LegModel, phase: FloatArray) -> Tip:
    """Return (U0, U1) of a leg, in any scale."""
    x, y = trajectory(phase)
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
