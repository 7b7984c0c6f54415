"""What a page is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from labdrive.report.scale import readable, scale_for, significant

LEADING = 12


@dataclass(frozen=True)
class Section:
    """A heading with a figure, a caption, a table, or any of these."""

    title: str
    figure: str = ""
    caption: str = ""
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


@dataclass(frozen=True)
class Fact:
    """A headline number and what it is."""

    value: str
    meaning: str


def harmonics_table(entry: Mapping[str, Any], unit: str) -> Section:
    """Return the harmonics that lead, with their standard errors."""
    leading = sorted(entry["harmonics"], key=lambda h: -h["amplitude"])[:LEADING]
    scale = scale_for(unit, leading[0]["amplitude"])
    return Section(
        "Leading harmonics",
        head=("harmonic", f"amplitude ({scale.unit})", f"standard error ({scale.unit})", "phase"),
        rows=[
            (
                str(h["k"]),
                significant(h["amplitude"] / scale.size, 4),
                significant(h["standard_error"] / scale.size, 2),
                f"{h['phase'] * 57.29577951308232:.1f}°",
            )
            for h in leading
        ],
        caption="The error over the phase is the sum of amplitude · cos(k·phase + phase offset).",
    )


def errors_row(name: str, entry: Mapping[str, Any], unit: str) -> tuple[str, ...]:
    """Return a row of name, step size, rms, peak-to-valley and noise floor."""
    error = entry["periodic_error"]
    return (
        name,
        readable(entry["step_size"], unit, 6),
        readable(error["rms"], unit),
        readable(error["pv"], unit),
        readable(entry["noise_floor"]["rms"], unit),
    )
