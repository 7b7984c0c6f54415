"""What a page is made of."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labdrive.report.entries import STANDS_OUT, Entry
from labdrive.report.scale import readable, scale_for, significant

LEADING = 12
FORMULA = (
    "e(φ) = Σ amplitude · cos(k φ + phase). The standard error is that of either quadrature, "
    f"and so that of an amplitude of several of it; {STANDS_OUT:g} make it stand out of the noise."
)


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


def errors_table(title: str, named: Mapping[str, Entry], unit: str) -> Section:
    """Return step size, error and noise of each entry, and what the optimizer remarked."""
    head = ["", "step size", "rms", "peak-to-valley", "noise floor, rms", "rms / noise floor"]
    rows = [_errors_row(name, entry, unit) for name, entry in named.items()]
    remarks = [str(entry.get("remark") or "") for entry in named.values()]
    if any(remarks):
        head.append("remark")
        rows = [[*row, remark] for row, remark in zip(rows, remarks, strict=True)]
    return Section(title, head=head, rows=rows)


def _errors_row(name: str, entry: Entry, unit: str) -> list[str]:
    error, floor = entry["periodic_error"], entry["noise_floor"]["rms"]
    return [
        name,
        readable(entry["step_size"], unit, 6),
        readable(error["rms"], unit),
        readable(error["pv"], unit),
        readable(floor, unit),
        ratio(error["rms"], floor),
    ]


def ratio(value: float, least: float) -> str:
    """Return how many times `least` a value is, in words where there is no such number."""
    return f"{significant(value / least)}" if least > 0 else "no noise"


def harmonics_table(named: Mapping[str, Entry], unit: str) -> Section:
    """Return the harmonics that lead in the first entry, as every entry has them."""
    by_order = {name: {h["k"]: h for h in entry["harmonics"]} for name, entry in named.items()}
    first = next(iter(by_order.values()))
    leading = sorted(first, key=lambda k: -first[k]["amplitude"])[:LEADING]
    head = ["k"]
    for name in named:
        head += [f"{name}: amplitude", "standard error", "phase"]
    rows = [
        [str(k), *(cell for found in by_order.values() for cell in _cells(found.get(k), unit))]
        for k in leading
    ]
    return Section("Leading harmonics", head=head, rows=rows, caption=FORMULA)


def _cells(harmonic: Mapping[str, float] | None, unit: str) -> tuple[str, str, str]:
    """Return amplitude and standard error, in one unit and to the same digit, and phase."""
    if harmonic is None:
        return "", "", ""
    amplitude, error = harmonic["amplitude"], harmonic["standard_error"]
    scale = scale_for(unit, max(amplitude, error))
    decimals = _decimals(error / scale.size) if error > 0 else 3
    return (
        f"{amplitude / scale.size:.{decimals}f} {scale.unit}",
        f"{error / scale.size:.{decimals}f} {scale.unit}",
        f"{math.degrees(harmonic['phase']):.1f}°",
    )


def _decimals(error: float) -> int:
    """Return the decimals that show two digits of an error."""
    return min(max(0, 1 - math.floor(math.log10(error))), 9)
