"""Speed of the legs' tips along their trajectory (paper, Figure 4a and c)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN
from labdrive.report.decimate import decimate
from labdrive.report.palette import COLOUR
from labdrive.report.svg import degrees_axis, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Table = Mapping[str, FloatArray]

POINTS = 1200


def tip_speed(table: Table, group: str = "A") -> FloatArray:
    """Return how fast a tip goes along its path [m a cycle], half-way after each entry."""
    x, y = (np.append(table[f"{axis}_{group}_m"], table[f"{axis}_{group}_m"][0]) for axis in "xy")
    return np.asarray(np.hypot(np.diff(x), np.diff(y)) * len(table["phase_rad"]))


def speeds(before: Table, after: Table) -> str:
    """Draw the speed of group A's tip over the phase, before and after."""

    def paint(axes: Sequence["Axes"]) -> None:
        paint_speed(axes[0], before, color=COLOUR["before"], label="before")
        paint_speed(axes[0], after, color=COLOUR["after"], label="after")
        axes[0].set_ylabel("speed of the tip (µm a cycle)")
        degrees_axis(axes[0])
        legend_above(axes[0])

    return draw("speed", paint)


def paint_speed(axes: "Axes", table: Table, *, color: str, label: str) -> None:
    """Draw the speed of group A's tip [um a cycle] over the phase."""
    speed = 1e6 * tip_speed(table)
    phase = np.degrees(table["phase_rad"]) + 180 / len(speed)
    axes.plot(*decimate(phase, speed, POINTS), color=color, label=label, lw=0.9)


def paint_voltage(axes: "Axes", named: Mapping[str, Table], colours: Sequence[str]) -> None:
    """Draw the first voltage of each table over the phase."""
    for (name, table), colour in zip(named.items(), colours, strict=True):
        phase = TURN * np.arange(len(table["U0_V"])) / len(table["U0_V"])
        axes.plot(
            *decimate(np.degrees(phase), table["U0_V"], POINTS), color=colour, label=name, lw=1.0
        )
    axes.set_ylabel("U0 (V)")
