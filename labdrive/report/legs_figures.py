"""Figures of identified legs: the tip over the phase, and the hysteresis loop (Figure 2a, b)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.decimate import decimate
from labdrive.report.palette import COLOUR
from labdrive.report.run_data import RunData
from labdrive.report.svg import degrees_axis, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 1200
UM = 1e-6
AXES = {"x": COLOUR["channel-0"], "y": COLOUR["channel-1"]}


def leg_path(run: RunData) -> str:
    """Draw x and y of the tips over the phase, as seen and by the model."""
    return draw("path", lambda axes: paint_leg_path(axes[0], run), height_in=3.0)


def leg_loops(run: RunData) -> str:
    """Draw deflection over the voltage that drives it, for both axes."""

    def paint(axes: Sequence["Axes"]) -> None:
        for one, axis in zip(axes, AXES, strict=True):
            paint_leg_loop(one, run, axis)

    return draw("loops", paint, columns=2, height_in=3.0)


def paint_leg_path(axes: "Axes", run: RunData) -> None:
    """Draw x and y of the tips over the phase: points as seen, lines by the model."""
    table = run.table(run.result["table"])
    phase = np.degrees(table["phase_rad"])
    every = max(1, len(phase) // 64)
    for axis, colour in AXES.items():
        seen, model = table[f"{axis}_m"] / UM, table[f"{axis}_model_m"] / UM
        axes.plot(phase[::every], seen[::every], ".", color=colour, ms=4, label=f"{axis} seen")
        axes.plot(*decimate(phase, model, POINTS), color=colour, lw=1.0, label=f"{axis} model")
    axes.set_ylabel("tip (µm)")
    degrees_axis(axes)
    legend_above(axes, columns=4)


def paint_leg_loop(axes: "Axes", run: RunData, axis: str = "x") -> None:
    """Draw the deflection along one axis over the voltage that drives it, and the model's line."""
    table = run.table(run.result["table"])
    drive, seen, model = (table[f"{axis}_{name}"] for name in ("drive_V", "m", "model_m"))
    axes.plot(_closed(drive), _closed(seen) / UM, color=AXES[axis], label="seen", lw=1.0)
    ends = [int(np.argmin(drive)), int(np.argmax(drive))]
    axes.plot(drive[ends], model[ends] / UM, color=COLOUR["before"], ls=":", label="model")
    axes.set_xlabel(f"{run.result['drives'][axis]} (V)")
    axes.set_ylabel(f"{axis} (µm)")
    legend_above(axes, columns=2)


def _closed(values: FloatArray) -> FloatArray:
    return np.append(values, values[0])
