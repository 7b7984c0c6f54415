"""Figures as inline SVG that comes out the same, byte for byte, whenever it is drawn."""

import io
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 7.2
STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
    "font.size": 9,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.constrained_layout.use": True,
}


def draw(
    name: str,
    paint: Callable[..., None],
    *,
    rows: int = 1,
    height_in: float = 2.9,
    **layout: Any,  # noqa: ANN401
) -> str:
    """Return the SVG that `paint` makes on axes stacked in `rows`.

    `name` must be the figure's own on its page: ids inside the SVG follow from it.
    """
    from matplotlib import rc_context  # noqa: PLC0415 0.3 s, needed by reports only
    from matplotlib.figure import Figure  # noqa: PLC0415 as above

    style: Any = {**STYLE, "svg.hashsalt": name}
    with rc_context(style):
        figure = Figure(figsize=(WIDTH_IN, height_in))
        axes = figure.subplots(rows, 1, sharex=rows > 1, **layout)
        paint(axes)
        return _svg(figure, name)


def _svg(figure: "Figure", name: str) -> str:
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    # Ids such as `axes_1` repeat from figure to figure; on one page they must not.
    text = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r'xlink:href="#([^"]+)"', rf'xlink:href="#{name}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", text)
    text = re.sub(r'<svg [^>]*?viewBox="([^"]+)"[^>]*>', _opening, text, count=1)
    return text.strip()


def _opening(match: re.Match[str]) -> str:
    return (
        f'<svg viewBox="{match[1]}" role="img" xmlns="http://www.w3.org/2000/svg" '
        'xmlns:xlink="http://www.w3.org/1999/xlink">'
    )


def degrees_axis(axes: "Axes") -> None:
    """Label the x axis as a phase over one cycle, in degrees."""
    axes.set_xlim(0, 360)
    axes.set_xticks(range(0, 361, 60))
    axes.set_xlabel("phase (deg)")
