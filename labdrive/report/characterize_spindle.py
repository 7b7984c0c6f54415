"""The report of a `characterize_spindle` run: ISO 230-2, and the periodic error both ways."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.decimate import decimate
from labdrive.report.palette import CHANNELS, COLOUR
from labdrive.report.reverse_check import paint_cases
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, scale_for
from labdrive.report.sections import Fact, Section, errors_table, harmonics_table, measured
from labdrive.report.svg import degrees_axis, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 2400
DIRECTIONS = ("forward", "backward")
PARAMETERS = {
    "mean_reversal_value": "mean reversal value",
    "reversal_value": "reversal value B",
    "repeatability_forward": "unidirectional repeatability, forward R↑",
    "repeatability_backward": "unidirectional repeatability, backward R↓",
    "repeatability": "bidirectional repeatability R",
    "systematic_deviation_forward": "systematic deviation, forward E↑",
    "systematic_deviation_backward": "systematic deviation, backward E↓",
    "systematic_deviation": "bidirectional systematic deviation E",
    "mean_bidirectional_deviation": "mean bidirectional positional deviation M",
    "accuracy_forward": "accuracy, forward A↑",
    "accuracy_backward": "accuracy, backward A↓",
    "accuracy": "bidirectional accuracy A",
}


def facts(run: RunData) -> list[Fact]:
    """Return the numbers to read first."""
    result, unit = run.result, run.result["unit"]
    iso, backlash = result["iso_230_2"], result["backlash"]
    lost = measured(backlash["value"], backlash["standard_error"], unit)
    shown = [
        Fact(lost, "backlash: the mean reversal value, as motion lost"),
        Fact(readable(iso["accuracy"], unit), "bidirectional accuracy A"),
        Fact(readable(iso["repeatability"], unit), "bidirectional repeatability R"),
    ]
    for direction, found in result["directions"].items():
        if "improvement" in found:
            times = f"{found['improvement']:.3g} times"
            shown.append(Fact(times, f"smaller periodic error {direction}, rms"))
    return shown


def summary(run: RunData) -> str:
    """Return in words what happened."""
    result, unit = run.result, run.result["unit"]
    lead = readable(result["lead"]["nominal"], unit)
    maps = (
        " Each direction has a map of its own; the backlash is in neither of them."
        if any("map" in found for found in result["directions"].values())
        else ""
    )
    return (
        f"{result['targets']} target positions, approached {result['runs']} times from each side; "
        f"nominal lead {lead}.{maps} The backlash is all that is lost on reversal: play, and the "
        "wind-up by friction."
    )


def sections(run: RunData) -> list[Section]:
    """Return figures and tables."""
    result, unit = run.result, run.result["unit"]
    iso, cases = result["iso_230_2"], _cases(result["directions"])
    rows = [[word, readable(iso[name], unit, 4)] for name, word in PARAMETERS.items()]
    shown = [
        Section(
            "Parameters of ISO 230-2",
            head=("", "value"),
            rows=rows,
            caption="Expanded by k = 2; the uncertainty of the measurement is not in them.",
        ),
        Section("Periodic error over the phase", _errors(cases, unit), "Mind the two scales."),
        errors_table("Periodic error", cases, unit),
        _cycles(result["cycles"], unit),
        harmonics_table({way: cases[f"{way}, before"] for way in DIRECTIONS}, unit),
    ]
    table = run.table("targets")
    if table:
        caption = "Mean deviation from the target, and two standard deviations either way."
        shown.insert(0, Section("Deviation at each target", _deviations(table, unit), caption))
    return shown


def _cases(directions: Mapping[str, Any]) -> dict[str, Any]:
    """Return every entry, by direction and by when it was recorded."""
    return {
        f"{direction}, {when}": found[when] | {"name": f"{direction}, {when}"}
        for when in ("before", "corrected")
        for direction, found in directions.items()
        if when in found
    }


def _deviations(table: Mapping[str, FloatArray], unit: str) -> str:
    largest = max(float(np.abs(table[f"{way}_m"]).max()) for way in DIRECTIONS)
    scale, along = scale_for(unit, largest), scale_for(unit, float(np.abs(table["target_m"]).max()))

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        for way, colour in zip(DIRECTIONS, CHANNELS, strict=False):
            mean, spread = table[f"{way}_m"] / scale.size, table[f"spread_{way}_m"] / scale.size
            place = table["target_m"] / along.size
            only.fill_between(
                place, mean - 2 * spread, mean + 2 * spread, color=colour, alpha=0.25, lw=0
            )
            only.plot(*decimate(place, mean, POINTS), color=colour, lw=1.0, label=way)
        only.axhline(0, color=COLOUR["ink"], lw=0.5)
        only.set_xlabel(f"target position ({along.unit})")
        only.set_ylabel(f"deviation ({scale.unit})")
        legend_above(only)

    return draw("deviations", paint, height_in=3.2)


def _errors(cases: Mapping[str, Any], unit: str) -> str:
    before = [case for name, case in cases.items() if name.endswith("before")]
    after = [case for name, case in cases.items() if name.endswith("corrected")]

    def paint(axes: Sequence["Axes"]) -> None:
        for one, shown in zip(axes, filter(None, (before, after)), strict=True):
            paint_cases(one, shown, unit)
        degrees_axis(axes[-1])

    return draw("directions", paint, rows=1 + bool(after), height_in=4.6 if after else 2.6)


def _cycles(cycles: Sequence[Mapping[str, Any]], unit: str) -> Section:
    """Return how much of the error repeats in each of the nested cycles."""
    names = [key for key in cycles[0] if isinstance(cycles[0][key], Mapping)]
    rows = [
        [
            str(cycle["name"]).replace("_", " "),
            str(cycle["per_revolution"]),
            *(readable(cycle[name]["rms"], unit) for name in names),
        ]
        for cycle in cycles
    ]
    head = ["cycle", "in a revolution", *(f"{name.replace('_', ', ')}, rms" for name in names)]
    caption = "A harmonic belongs to the shortest cycle that it is a whole multiple of."
    return Section("Nested cycles", head=head, rows=rows, caption=caption)
