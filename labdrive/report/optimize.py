"""The report of an `optimize` run."""

from collections.abc import Mapping
from typing import Any

from labdrive.report import figures
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, significant
from labdrive.report.sections import Fact, Section, errors_row, harmonics_table

WHY = {
    "noise_floor": "It stopped because no harmonic stands out of its standard error any more.",
    "converged": "It stopped because a further update gained next to nothing.",
    "max_iterations": "It stopped because the recipe allows no more updates.",
}


def facts(run: RunData) -> list[Fact]:
    """Return the numbers to read first."""
    result = run.result
    unit, after = result["unit"], result["verification"]
    before = result["iterations"][0]["periodic_error"]
    error, floor = after["periodic_error"], after["noise_floor"]["rms"]
    ratio = f"{significant(error['rms'] / floor, 2)} ×" if floor else "no noise"
    return [
        Fact(f"{significant(result['improvement'])} ×", "smaller periodic error, rms"),
        Fact(
            f"{readable(before['rms'], unit)} → {readable(error['rms'], unit)}",
            f"rms; peak-to-valley {readable(before['pv'], unit)} → {readable(error['pv'], unit)}",
        ),
        Fact(ratio, f"the noise floor of {readable(floor, unit)} rms"),
    ]


def summary(run: RunData) -> str:
    """Return in words what happened."""
    result = run.result
    updates = len(result["iterations"]) - 1
    return (
        f"{updates} update{'s' if updates != 1 else ''} of the phase map. {WHY[result['stopped']]} "
        f"The table of iteration {result['best_iteration']} was the best; the numbers above are "
        "from a recording of it that no fit has seen."
    )


def sections(run: RunData) -> list[Section]:
    """Return figures and tables, in reading order."""
    result, unit = run.result, run.result["unit"]
    iterations, verification = result["iterations"], result["verification"]
    before_after = {"before": iterations[0], "verification": verification}
    return [
        Section(
            "Periodic error over the phase",
            figures.errors_over_phase(iterations, verification, unit),
            "Filtered to the harmonics of the cycle; each line is one recording.",
        ),
        Section(
            "Convergence",
            figures.convergence(iterations, verification, unit),
            "The shaded band is what noise alone would show.",
        ),
        Section(
            "Harmonics",
            figures.harmonics(before_after, unit),
            "Bars are one standard error.",
        ),
        *_waveform_sections(run, result),
        *_residual_sections(run, before_after, unit),
        Section(
            "Iterations",
            head=("", "step size", "rms", "peak-to-valley", "noise floor, rms"),
            rows=[
                *(errors_row(str(i), entry, unit) for i, entry in enumerate(iterations)),
                errors_row("verification", verification, unit),
            ],
        ),
        harmonics_table(iterations[0], unit),
    ]


def _waveform_sections(run: RunData, result: Mapping[str, Any]) -> list[Section]:
    tables = {i["iteration"]: run.table(i["table"]) for i in result["iterations"]}
    first, best = tables[0], tables[result["best_iteration"]]
    if not first or not best:
        return []
    shown = [Section("Waveforms", figures.waveforms(first, best))]
    updated = {f"iteration {i}": table for i, table in tables.items() if i and table}
    if updated:
        caption = "How far the corrected phase runs ahead of the commanded one."
        shown.append(Section("Phase map", figures.phase_maps(updated), caption))
    return shown


def _residual_sections(
    run: RunData, named: Mapping[str, Mapping[str, Any]], unit: str
) -> list[Section]:
    read = {name: run.reading(e["recording"], run.result["sensor"]) for name, e in named.items()}
    found = {name: curve for name, curve in read.items() if curve is not None}
    if not found:
        return []
    caption = "As read, unfiltered, less a straight line: drift and noise included."
    return [Section("Raw recordings", figures.residuals(found, unit), caption)]
