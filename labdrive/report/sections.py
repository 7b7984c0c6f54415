"""What a page is made of."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labdrive.report.entries import STANDS_OUT, Entry
from labdrive.report.scale import Scale, minus, readable, scale_for, significant

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
        _step(entry, unit),
        readable(error["rms"], unit),
        readable(error["pv"], unit),
        readable(floor, unit),
        ratio(error["rms"], floor),
    ]


def _step(entry: Entry, unit: str) -> str:
    step, error = entry["step_size"], entry.get("step_size_standard_error")
    return measured(step, error, unit) if error else readable(step, unit, 6)


def measured(value: float, error: float, unit: str) -> str:
    """Return an SI value, plus or minus its standard error, with a unit."""
    scale = scale_for(unit, max(abs(value), error))
    number, uncertainty = scale.measured(value, error)
    return f"{number} ± {uncertainty}\N{NO-BREAK SPACE}{scale.unit}"


def ratio(value: float, least: float) -> str:
    """Return how many times `least` a value is, in words where there is no such number."""
    return f"{significant(value / least)}" if least > 0 else "no noise"


def harmonics_table(named: Mapping[str, Entry], unit: str) -> Section:
    """Return the harmonics that lead in the first entry, as every entry has them."""
    first = next(iter(named.values()))["harmonics"]
    leading = [h["k"] for h in sorted(first, key=lambda h: -h["amplitude"])[:LEADING]]
    head, columns = ["k"], [[str(k) for k in leading]]
    for name, entry in named.items():
        found = {h["k"]: h for h in entry["harmonics"]}
        there = [found.get(k) for k in leading]
        sizes = sorted(h["amplitude"] for h in there if h)
        scale = scale_for(unit, sizes[len(sizes) // 2] if sizes else 0)
        amplitude = f"{name}: amplitude" if name else "amplitude"
        head += [f"{amplitude} ({scale.unit})", "standard error", "phase"]
        columns += map(list, zip(*(_cells(h, scale) for h in there), strict=True))
    rows = list(zip(*columns, strict=True))
    return Section("Leading harmonics", head=head, rows=rows, caption=FORMULA)


def _cells(harmonic: Mapping[str, float] | None, scale: Scale) -> tuple[str, str, str]:
    """Return amplitude, standard error and phase; nothing where there is no such harmonic."""
    if harmonic is None:
        return "", "", ""
    amplitude, error = scale.measured(harmonic["amplitude"], harmonic["standard_error"])
    return amplitude, error, minus(f"{math.degrees(harmonic['phase']):.1f}°")
