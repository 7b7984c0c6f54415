"""Figures as files, fit for a publication: fonts embedded, no time or tool in them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labdrive.report.svg import STYLE, WIDTH_IN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL_IN = 2.9
NOTHING: dict[str, dict[str, None]] = {
    "svg": dict.fromkeys(("Date", "Creator", "Format", "Type")),
    "pdf": dict.fromkeys(("CreationDate", "Creator", "Producer")),
}


def publish(
    stem: Path, paint: Callable[[Sequence["Axes"]], None], *, rows: int, columns: int
) -> list[Path]:
    """Write STEM.svg, letters as outlines, and STEM.pdf, letters as text; return both paths."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: Any = {**STYLE, "svg.hashsalt": stem.name, "svg.fonttype": "path", "pdf.fonttype": 42}
    with rc_context(style):
        width = WIDTH_IN * max(1, columns / 2)
        figure = Figure(figsize=(width, PANEL_IN * rows))
        paint(list(figure.subplots(rows, columns, squeeze=False).flat))
        paths = []
        for format_ in ("svg", "pdf"):
            paths.append(stem.with_suffix(f".{format_}"))
            figure.savefig(paths[-1], format=format_, metadata=NOTHING[format_])
    return paths
