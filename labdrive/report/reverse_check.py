"""The report of a `reverse_check` run: the paper's Figure 5."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.report.decimate import decimate
from labdrive.report.entries import Entry, degrees, error_over_cycle
from labdrive.report.palette import CHANNELS, COLOUR
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, scale_for
from labdrive.report.sections import Fact, Section, errors_table
from labdrive.report.svg import degrees_axis, draw, legend_above
from labdrive.report.table_figures import waveforms

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 1600
LARGE = "unoptimized"


def named(case: Entry) -> str:
    """Return a case's name in words."""
    return str(case["name"]).replace("_", " ")


def facts(run: RunData) -> list[Fact]:
    """Return the error of each case."""
    unit = run.result["unit"]
    return [
        Fact(readable(case["periodic_error"]["rms"], unit), f"{named(case)}, rms")
        for case in run.result["cases"]
    ]


def summary(run: RunData) -> str:
    """Return in words what the cases are and what the reverse table is for."""
    text = (
        "The waveform was optimized forward, then played as it is in both directions. Swapped: the "
        "voltages of each leg exchanged and the phase inverted."
    )
    jump = run.result.get("switch_jump")
    if jump is None:
        return text
    return (
        f"{text} tables/reverse.csv is that table; whoever turns round at phase φ goes on in it at "
        f"switch_phase_rad of tables/forward.csv, where no tip jumps by more than "
        f"{readable(jump, 'm')}."
    )


def sections(run: RunData) -> list[Section]:
    """Return figures and tables."""
    result, unit = run.result, run.result["unit"]
    rows = {named(case): case for case in result["cases"]}
    caption = "Mind the two scales."
    shown = [
        Section("Periodic error over the phase", _errors(result), caption),
        errors_table("Cases", rows, unit),
    ]
    if "cross" in result:
        shown.append(_crossed(result["cross"], unit))
    forward, reverse = run.table("forward"), run.table(result.get("reverse_table", ""))
    if forward and reverse:
        text = "Dashed: forward. Full: the reverse table, over its own phase."
        plain = {name: column for name, column in forward.items() if name in reverse}
        shown.append(Section("Waveforms", waveforms(plain, reverse), text))
    return shown


def _errors(result: Mapping[str, Any]) -> str:
    def paint(axes: Sequence["Axes"]) -> None:
        cases = result["cases"]
        paint_cases(axes[0], [c for c in cases if c["name"].startswith(LARGE)], result["unit"])
        paint_cases(axes[1], [c for c in cases if not c["name"].startswith(LARGE)], result["unit"])
        degrees_axis(axes[1])

    return draw("cases", paint, rows=2, height_in=4.6)


def paint_cases(axes: "Axes", cases: Sequence[Entry], unit: str) -> None:
    """Draw the periodic error of each case over the phase."""
    curves = {named(case): error_over_cycle(case) for case in cases}
    scale = scale_for(unit, max(float(np.abs(curve).max()) for curve in curves.values()))
    axes.axhline(0, color=COLOUR["ink"], lw=0.5)
    for (name, curve), colour in zip(curves.items(), CHANNELS, strict=False):
        phase, error = decimate(degrees(curve), curve / scale.size, POINTS)
        axes.plot(phase, error, color=colour, label=name, lw=1.0)
    axes.set_ylabel(f"periodic error ({scale.unit})")
    legend_above(axes, columns=3)


def _crossed(cross: Sequence[Entry], unit: str) -> Section:
    """Return each map's error in each direction."""
    ways = ("forward", "backward")
    found = {(e["map"], e["direction"]): e["periodic_error"]["rms"] for e in cross}
    rows = [[f"map from {of}", *(readable(found[of, way], unit) for way in ways)] for of in ways]
    head = ["", *(f"applied {way}" for way in ways)]
    return Section("Each map in each direction, rms", head=head, rows=rows)
