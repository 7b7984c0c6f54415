"""The paper's Figures 2 to 5 from several runs: one page, and each figure fit to be published."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.model.errors import InputError, StoreError
from labdrive.report.decimate import decimate
from labdrive.report.entries import degrees, error_over_cycle
from labdrive.report.legs_figures import paint_leg_loop, paint_leg_path
from labdrive.report.load_figures import paint_load_curves, paint_trajectories
from labdrive.report.palette import COLOUR, sequence, variables
from labdrive.report.publish import publish
from labdrive.report.reverse_check import paint_cases
from labdrive.report.run_data import RunData
from labdrive.report.scale import scale_for
from labdrive.report.scaling_sweep import scaled_tables
from labdrive.report.svg import degrees_axis, draw, legend_above
from labdrive.report.tip_figures import paint_speed, paint_voltage

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = ("identify_legs", "load_sweep", "scaling_sweep", "optimize", "reverse_check")
POINTS = 1600


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper: its panels, in reading order, `columns` to a row."""

    number: int
    caption: str
    runs: list[RunData]
    panels: Sequence[Callable[["Axes"], None]]
    columns: int

    @property
    def rows(self) -> int:
        """Rows of panels."""
        return -(-len(self.panels) // self.columns)

    def paint(self, axes: Sequence["Axes"]) -> None:
        """Draw every panel on its axes, with its letter where there are several."""
        for letter, one, panel in zip("abcdef", axes, self.panels, strict=False):
            panel(one)
            if len(self.panels) > 1:
                one.set_title(f"{letter})")
        for unused in axes[len(self.panels) :]:
            unused.set_axis_off()


def write_paper(folders: Sequence[Path], out: Path) -> list[Path]:
    """Write paper.html and the figures as SVG and PDF into `out`; return their paths.

    InputError if no run is of a kind that the paper shows; StoreError if a file cannot be read
    or written.
    """
    figures = list(_figures([RunData(folder) for folder in folders]))
    if not figures:
        raise InputError(f"none of the runs shows a figure of the paper; take {', '.join(KINDS)}")
    try:
        out.mkdir(parents=True, exist_ok=True)
        written = [out / "paper.html"]
        written[0].write_text(_page(figures), encoding="utf-8", newline="\n")
        for figure in figures:
            stem = out / f"figure-{figure.number}"
            written += publish(stem, figure.paint, rows=figure.rows, columns=figure.columns)
    except OSError as error:
        raise StoreError(f"cannot write into {out}: {error.strerror or error}") from error
    return written


def _figures(runs: Sequence[RunData]) -> Iterator[PaperFigure]:
    """Yield the figures for which there are runs."""
    of: dict[str, list[RunData]] = {kind: [] for kind in KINDS}
    for run in runs:
        of.get(run.result.get("kind", ""), []).append(run)
    yield from _figure_2(of["identify_legs"][-1:], of["load_sweep"][-1:])
    yield from map(_figure_3, of["scaling_sweep"][-1:])
    if of["optimize"]:
        yield _figure_4(of["optimize"])
    yield from map(_figure_5, of["reverse_check"][-1:])


def _figure_2(legs: list[RunData], loads: list[RunData]) -> Iterator[PaperFigure]:
    panels: list[Callable[[Axes], None]] = []
    captions = []
    for run in legs:
        panels += [_on(paint_leg_path, run), _on(paint_leg_loop, run)]
        captions.append(
            "Tips of the legs over the phase, with the linear model; deflection along the travel "
            "over the voltage that drives it."
        )
    for run in loads:
        panels.append(_on(paint_load_curves, run.result))
        captions.append("Step size over external load.")
    if panels:
        yield PaperFigure(2, " ".join(captions), [*legs, *loads], panels, len(panels))


def _figure_3(run: RunData) -> PaperFigure:
    panels = [_on(paint_load_curves, run.result)]
    if tables := scaled_tables(run):
        panels.append(_on(paint_trajectories, tables))
    caption = (
        "Step size over external load for scaled trajectories (dotted: x, full: y, dashed: both), "
        "and the trajectories of the tips by the linear model."
    )
    return PaperFigure(3, caption, [run], panels, 2)


def _figure_4(runs: list[RunData]) -> PaperFigure:
    panels: list[Callable[[Axes], None]] = []
    for run in runs:
        panels += [_on(_paint_waveform, run), _on(_paint_iterations, run)]
    names = ", then ".join(_trajectory(run) for run in runs)
    caption = (
        f"Voltage U0 of each iteration, speed of the tip before and after (dotted, right axis), "
        f"and the periodic error of each iteration: {names}."
    )
    return PaperFigure(4, caption, runs, panels, 2)


def _figure_5(run: RunData) -> PaperFigure:
    def panel(axes: "Axes") -> None:
        paint_cases(axes, run.result["cases"], run.result["unit"])
        degrees_axis(axes)

    caption = "Periodic error in both directions, before and after, and with the swapped table."
    return PaperFigure(5, caption, [run], [panel], 1)


def _on(paint: Callable[["Axes", Any], None], data: Any) -> Callable[["Axes"], None]:
    return lambda axes: paint(axes, data)


def _trajectory(run: RunData) -> str:
    """Return the name of a run's trajectory, from its recipe as resolved."""
    import yaml

    recipe = yaml.safe_load(run.text("recipe.yaml")) or {}
    waveform = recipe.get("waveform") or {}
    return Path(str(waveform.get("trajectory", run.folder.name))).stem


def _paint_waveform(axes: "Axes", run: RunData) -> None:
    """Draw U0 of each iteration, and the tip's speed of the first and the best."""
    iterations = run.result["iterations"]
    tables = {f"{e['iteration']}": run.table(e["table"]) for e in iterations}
    colours = [COLOUR["before"], *sequence(len(tables) - 1)]
    paint_voltage(axes, {n: t for n, t in tables.items() if "U0_V" in t}, colours)
    right = axes.twinx()
    right.spines["right"].set_visible(True)
    right.grid(visible=False)
    for which, colour in ((0, COLOUR["before"]), (run.result["best_iteration"], COLOUR["accent"])):
        table = tables[str(which)]
        if "x_A_m" in table:
            paint_speed(right, table, color=colour, label="")
    for line in right.lines:
        line.set_linestyle((0, (1, 1.2)))
    right.set_ylabel("tip speed (µm a cycle)")
    degrees_axis(axes)
    legend_above(axes, columns=6)


def _paint_iterations(axes: "Axes", run: RunData) -> None:
    """Draw the periodic error of each iteration over the phase."""
    iterations = run.result["iterations"]
    curves = {str(e["iteration"]): error_over_cycle(e) for e in iterations}
    scale = scale_for(run.result["unit"], max(float(np.abs(c).max()) for c in curves.values()))
    colours = [COLOUR["before"], *sequence(len(curves) - 1)]
    for (name, curve), colour in zip(curves.items(), colours, strict=True):
        phase, error = decimate(degrees(curve), curve / scale.size, POINTS)
        axes.plot(phase, error, color=colour, label=name, lw=1.0)
    axes.set_ylabel(f"periodic error ({scale.unit})")
    degrees_axis(axes)
    legend_above(axes, columns=6)


def _page(figures: Sequence[PaperFigure]) -> str:
    from jinja2 import Environment, FileSystemLoader

    templates = FileSystemLoader(Path(__file__).with_name("templates"))
    environment = Environment(
        loader=templates, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    drawn = [
        draw(
            f"figure-{figure.number}",
            figure.paint,
            rows=figure.rows,
            columns=figure.columns,
            height_in=2.9 * figure.rows,
        )
        for figure in figures
    ]
    return environment.get_template("paper.html").render(
        light=variables(dark=False),
        dark=variables(dark=True),
        figures=list(zip(figures, drawn, strict=True)),
    )
