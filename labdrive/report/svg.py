"""Figures as inline SVG that comes out the same, byte for byte, whenever it is drawn."""

import io
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from labdrive.report.palette import COLOUR, follow_page
from labdrive.report.scale import Scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 7.2
STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "text.parse_math": False,
    # Shipped with matplotlib, so that the layout is the same on every machine; the page's own
    # font, which is narrower, takes its place.
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "text.color": COLOUR["ink"],
    "axes.labelsize": 8.5,
    "axes.labelcolor": COLOUR["ink"],
    "axes.edgecolor": COLOUR["ink"],
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "axes.xmargin": 0.01,
    "axes.formatter.useoffset": False,
    "grid.color": COLOUR["grid"],
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "lines.solid_joinstyle": "round",
    "xtick.color": COLOUR["ink"],
    "ytick.color": COLOUR["ink"],
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.4,
    "figure.constrained_layout.use": True,
}


def draw(
    name: str,
    paint: Callable[[Sequence["Axes"]], None],
    *,
    rows: int = 1,
    columns: int = 1,
    height_in: float = 2.6,
) -> str:
    """Return the SVG that `paint` makes on axes stacked in `rows`, or beside one another.

    `name` must be the figure's own on its page: ids inside the SVG follow from it.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: Any = {**STYLE, "svg.hashsalt": name}
    with rc_context(style):
        figure = Figure(figsize=(WIDTH_IN, height_in))
        axes = figure.subplots(rows, columns, sharex=rows > 1 and columns == 1, squeeze=False)
        paint(list(axes.flat))
        figure.align_ylabels()
        return _svg(figure, name)


def _svg(figure: "Figure", name: str) -> str:
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    width, height = 72 * figure.get_size_inches()
    body = text[text.index("<defs>") :].replace("font-family: 'DejaVu Sans'; ", "")
    opening = f'<svg viewBox="0 0 {width:g} {height:g}" aria-hidden="true">\n'
    return opening + follow_page(_short_paths(_own_ids(body, name))).strip()


def _own_ids(svg: str, name: str) -> str:
    """Prefix ids with the figure's name: they repeat from figure to figure, as `axes_1` does."""
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', svg)
    svg = re.sub(r'xlink:href="#([^"]+)"', rf'href="#{name}-\1"', svg)
    return re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", svg)


def _short_paths(svg: str) -> str:
    """Round to a hundredth of a point, finer than any screen or press."""
    numbers = re.compile(r"-?\d+\.\d+")

    def shorten(found: re.Match[str]) -> str:
        return numbers.sub(lambda n: f"{float(n[0]):.2f}".rstrip("0").rstrip("."), found[0])

    return re.sub(r'\b(?:d|x|y|transform)="[^"]+"', shorten, svg)


def legend_above(axes: "Axes", columns: int = 5) -> None:
    """Put the legend above the axes on the right, where it covers nothing.

    Panels beside one another have no room there: in them it goes where it covers least.
    """
    if beside_others(axes):
        axes.legend(loc="best", fontsize=6.5, handlelength=1.2, labelspacing=0.25, borderpad=0.2)
        return
    axes.legend(
        loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.1, ncols=columns, borderpad=0.2
    )


def beside_others(axes: "Axes") -> bool:
    """Return whether the axes share their row with others."""
    grid = axes.get_gridspec()
    return grid is not None and grid.ncols > 1


def degrees_axis(axes: "Axes") -> None:
    """Label the x axis as a phase over one cycle, in degrees."""
    axes.set_xlim(0, 360)
    axes.set_xticks(range(0, 361, 90 if beside_others(axes) else 45))
    axes.set_xlabel("phase φ (deg)")


def log_axis(axes: "Axes", scale: Scale, low: float, high: float) -> None:
    """Make the y axis, which is in `scale`, logarithmic from `low` to `high` [SI]."""
    from matplotlib.ticker import NullFormatter

    axes.set_yscale("log")
    axes.set_ylim(low / scale.size, high / scale.size)
    axes.yaxis.set_major_formatter(lambda value, _: scale.decade(value))
    axes.yaxis.set_minor_formatter(NullFormatter())
