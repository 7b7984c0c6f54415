"""A number over many runs, as a control chart."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labdrive.report.history import Trend
from labdrive.report.palette import COLOUR
from labdrive.report.publish import NOTHING
from labdrive.report.scale import scale_for
from labdrive.report.svg import STYLE, WIDTH_IN, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_trend(trend: Trend, path: Path) -> None:
    """Draw the points with centre and control limits into an SVG or PDF file."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: dict[str, object] = {**STYLE, "svg.hashsalt": "trend"}
    with rc_context(style):  # type: ignore[arg-type]  # keys are matplotlib's own literals
        figure = Figure(figsize=(WIDTH_IN, 2.8))
        _paint(figure.subplots(), trend)
        kind = path.suffix.lstrip(".") or "svg"
        figure.savefig(path, format=kind, metadata=NOTHING.get(kind))


def _paint(axes: "Axes", trend: Trend) -> None:
    values = np.array([point.value for point in trend.points])
    scale = scale_for(trend.unit, float(np.abs(values).max()))
    runs = np.arange(1, len(values) + 1)
    alarming = np.array([bool(point.alarm) for point in trend.points])
    axes.axhspan(
        trend.low / scale.size, trend.high / scale.size, color=COLOUR["noise"], lw=0, label="limits"
    )
    axes.axhline(trend.centre / scale.size, color=COLOUR["before"], lw=0.8)
    axes.plot(runs, values / scale.size, "o-", color=COLOUR["after"], lw=0.8)
    axes.plot(
        runs[alarming], values[alarming] / scale.size, "o", color=COLOUR["accent"], label="alarm"
    )
    axes.set_xlabel("run")
    axes.set_ylabel(f"{trend.metric} ({scale.unit})")
    legend_above(axes)
