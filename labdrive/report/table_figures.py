"""Figures of what was played, and of what was read before any filter."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.decimate import decimate
from labdrive.report.palette import CHANNELS, COLOUR, sequence
from labdrive.report.recordings import Residual
from labdrive.report.scale import scale_for
from labdrive.report.svg import degrees_axis, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Table = Mapping[str, FloatArray]

POINTS = 1200
PHASES = ("phase_rad", "psi_rad")
TIPS = ("x_A_m", "y_A_m", "x_B_m", "y_B_m")


def waveforms(before: Table, after: Table) -> str:
    """Draw every output over the phase, dashed before and full after."""
    outputs = [name for name in before if name not in (*PHASES, *TIPS) and name in after]

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        pairs = {name: (_output(name, before), _output(name, after)) for name in outputs}
        unit = outputs[0].rpartition("_")[2] if outputs else ""
        largest = max((float(np.abs(y).max()) for pair in pairs.values() for y in pair), default=1)
        scale = scale_for(unit, largest)
        for number, (name, (old, new)) in enumerate(pairs.items()):
            colour = CHANNELS[number % len(CHANNELS)]
            _line(only, before, old / scale.size, color=colour, ls=(0, (4, 2)), lw=0.8)
            _line(only, after, new / scale.size, color=colour, label=name.rpartition("_")[0])
        degrees_axis(only)
        only.set_ylabel(
            f"angle − phase ({scale.unit})" if unit == "rad" else f"output ({scale.unit})"
        )
        legend_above(only)

    return draw("waveforms", paint)


def _output(name: str, table: Table) -> FloatArray:
    """Return a channel's samples; an angle, which gains a turn in a cycle, less the phase."""
    return table[name] - table["phase_rad"] if name.endswith("_rad") else table[name]


def phase_maps(tables: Mapping[str, Table]) -> str:
    """Draw corrected phase less commanded phase for each table."""
    shifts = {name: table["psi_rad"] - table["phase_rad"] for name, table in tables.items()}
    scale = scale_for("rad", max(float(np.abs(shift).max()) for shift in shifts.values()))

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        only.axhline(0, color=COLOUR["ink"], lw=0.5)
        for (name, shift), colour in zip(shifts.items(), sequence(len(shifts)), strict=True):
            _line(only, tables[name], shift / scale.size, color=colour, label=name)
        degrees_axis(only)
        only.set_ylabel(f"ψ − φ ({scale.unit})")
        legend_above(only)

    return draw("map", paint)


def _line(axes: "Axes", table: Table, values: FloatArray, **style: Any) -> None:
    axes.plot(*decimate(np.degrees(table["phase_rad"]), values, POINTS), **style)


def residuals(named: Mapping[str, Residual]) -> str:
    """Draw readings less a straight line, over whole recordings, each on its own scale."""
    colours = ("before", "accent") if len(named) > 1 else ("after",)

    def paint(axes: Sequence["Axes"]) -> None:
        for one, (name, residual), colour in zip(axes, named.items(), colours, strict=True):
            scale = scale_for(residual.unit, float(np.abs(residual.off).max()))
            one.plot(residual.cycles, residual.off / scale.size, color=COLOUR[colour], lw=0.6)
            one.set_title(name)
            one.set_ylabel(f"reading − line ({scale.unit})")
        axes[-1].set_xlabel("phase (cycles)")

    return draw("residual", paint, rows=len(named), height_in=0.4 + 1.9 * len(named))
