"""Figures of drives under load: step size over load, and the trajectories behind it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.entries import Entry
from labdrive.report.palette import CHANNELS, COLOUR
from labdrive.report.scale import scale_for
from labdrive.report.svg import beside_others, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Key = tuple[str, float, float]

MARKERS = "os^Dvp"
# More curves than that leave no room for their names in a panel; the one beside it has them.
FEW = 4
LINES: Mapping[str, Any] = {"": "-", "x": (0, (1, 1.5)), "y": "-", "both": (0, (5, 2))}


def key_of(entry: Entry) -> Key:
    """Return what tells a curve from others: waveform, x scale, y scale."""
    return entry["waveform"], entry["x_scale"], entry["y_scale"]


def name_of(key: Key) -> str:
    """Return a curve's name as a reader needs it."""
    waveform, x_scale, y_scale = key
    return waveform if (x_scale, y_scale) == (1, 1) else f"{x_scale:g} x, {y_scale:g} y"


def load_curves(result: Mapping[str, Any]) -> str:
    """Draw step size over load, a curve a waveform."""
    return draw("loads", lambda axes: paint_load_curves(axes[0], result), height_in=3.4)


def paint_load_curves(axes: "Axes", result: Mapping[str, Any]) -> None:
    """Draw the points of every curve with their standard errors, and where each stalls."""
    styles = _styles(result["curves"])
    largest = max(abs(point["step_size"]) for point in result["points"])
    scale = scale_for(result["unit"], largest)
    for curve in result["curves"]:
        points = [point for point in result["points"] if key_of(point) == key_of(curve)]
        style = styles[key_of(curve)]
        axes.errorbar(
            _column(points, "load"),
            _column(points, "step_size") / scale.size,
            xerr=_column(points, "load_standard_error"),
            yerr=_column(points, "standard_error") / scale.size,
            label=name_of(key_of(curve)),
            ms=3.2,
            elinewidth=0.8,
            **style,
        )
        if curve["stall_load"] is not None:
            axes.plot([curve["stall_load"]], [0], "|", color=style["color"], ms=11, mew=1.4)
    axes.axhline(0, color=COLOUR["ink"], lw=0.5)
    axes.set_xlabel("load (N)")
    axes.set_ylabel(f"step size ({scale.unit})")
    axes.set_xlim(left=0)
    if len(styles) <= FEW or not beside_others(axes):
        legend_above(axes, columns=4)


def _styles(curves: Sequence[Entry]) -> dict[Key, dict[str, Any]]:
    """Return colour, marker and line of each curve: colour by scale, line by what is scaled."""
    waveforms = list(dict.fromkeys(curve["waveform"] for curve in curves))
    scales = sorted({min(curve["x_scale"], curve["y_scale"]) for curve in curves}, reverse=True)
    several = len(waveforms) > 1
    styles = {}
    for curve in curves:
        waveform, x_scale, y_scale = key_of(curve)
        which = waveforms.index(waveform) if several else scales.index(min(x_scale, y_scale))
        scaled = "both" if x_scale == y_scale != 1 else "x" if x_scale != 1 else "y"
        styles[key_of(curve)] = {
            "color": CHANNELS[which % len(CHANNELS)],
            "marker": MARKERS[which % len(MARKERS)],
            "linestyle": LINES["" if (x_scale, y_scale) == (1, 1) else scaled],
        }
    return styles


def trajectories(named: Mapping[Key, Mapping[str, FloatArray]]) -> str:
    """Draw the path of a leg's tip for each waveform, by the leg model."""
    return draw("trajectories", lambda axes: paint_trajectories(axes[0], named), height_in=2.7)


def paint_trajectories(axes: "Axes", named: Mapping[Key, Mapping[str, FloatArray]]) -> None:
    """Draw y over x of group A of each table, both on one scale."""
    keys = [dict(zip(("waveform", "x_scale", "y_scale"), key, strict=True)) for key in named]
    styles = _styles(keys)
    for key, table in named.items():
        style = {**styles[key], "marker": ""}
        x, y = (np.append(table[name], table[name][0]) * 1e6 for name in ("x_A_m", "y_A_m"))
        axes.plot(x, y, label=name_of(key), **style)
    axes.set_aspect("equal")
    axes.set_xlabel("x, along the travel (µm)")
    axes.set_ylabel("y, towards the rod (µm)")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def _column(points: Sequence[Entry], name: str) -> FloatArray:
    return np.array([point[name] for point in points], dtype=np.float64)
