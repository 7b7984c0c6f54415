"""The report of an `optimize` run."""

from collections.abc import Mapping
from typing import Any

from labdrive.report.entries import STANDS_OUT, Entry
from labdrive.report.error_figures import convergence, errors_over_phase
from labdrive.report.harmonic_figures import harmonics
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, significant
from labdrive.report.sections import Fact, Section, errors_table, harmonics_table, ratio
from labdrive.report.table_figures import PHASES, TIPS, phase_maps, residuals, waveforms
from labdrive.report.tip_figures import speeds

WHY = {
    "noise_floor": "It stopped because no harmonic stands out of the noise any more.",
    "converged": "It stopped because a further update gained next to nothing.",
    "max_iterations": "It stopped because the recipe allows no more updates.",
}


def facts(run: RunData) -> list[Fact]:
    """Return the numbers to read first."""
    result, unit = run.result, run.result["unit"]
    before = result["iterations"][0]["periodic_error"]
    after, floor = result["verification"]["periodic_error"], result["verification"]["noise_floor"]
    return [
        Fact(f"{significant(result['improvement'])} ×", "smaller periodic error, rms"),
        Fact(
            f"{readable(before['rms'], unit)} → {readable(after['rms'], unit)}",
            "periodic error, rms",
        ),
        Fact(
            f"{readable(before['pv'], unit)} → {readable(after['pv'], unit)}",
            "periodic error, peak-to-valley",
        ),
        Fact(readable(floor["rms"], unit), "noise floor of the verification, rms"),
    ]


def summary(run: RunData) -> str:
    """Return in words what happened."""
    result = run.result
    updates = len(result["iterations"]) - 1
    after, floor = result["verification"]["periodic_error"], result["verification"]["noise_floor"]
    left = (
        f"What is left is {ratio(after['rms'], floor['rms'])} times what noise alone would show."
        if floor["rms"] > 0
        else "The recording shows no noise."
    )
    return (
        f"The phase map was updated {_times(updates)}. "
        f"{WHY.get(result['stopped'], 'It stopped: ' + result['stopped'] + '.')} "
        f"Iteration {result['best_iteration']} was the best; the numbers above are from one more "
        f"recording of it, made by {result['sensor']}, which no fit has seen. {left}"
    )


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def sections(run: RunData) -> list[Section]:
    """Return figures and tables, in reading order."""
    result, unit = run.result, run.result["unit"]
    iterations, verification = result["iterations"], result["verification"]
    before_after = {"before": iterations[0], "verification": verification}
    rows = {str(entry["iteration"]): entry for entry in iterations} | {"verification": verification}
    return [
        Section(
            "Periodic error over the phase",
            errors_over_phase(iterations, verification, unit),
            "The harmonics of the cycle, with drift and noise between them left out. Mind the two "
            "scales.",
        ),
        Section(
            "Convergence",
            convergence(iterations, verification, unit),
            "The band is the rms that noise alone would show in each recording.",
        ),
        errors_table("Iterations", rows, unit),
        Section(
            "Harmonics",
            harmonics(before_after, unit),
            f"Bars: one standard error. Hollow: within {STANDS_OUT:g} standard errors, as noise "
            "alone would be.",
        ),
        harmonics_table(before_after, unit),
        *_played(run, iterations, result["best_iteration"]),
        *_raw(run, before_after),
    ]


def _played(run: RunData, iterations: list[Entry], best: int) -> list[Section]:
    """Return the waveforms and phase maps, of those iterations whose tables are there."""
    tables = {entry["iteration"]: run.table(entry.get("table", "")) for entry in iterations}
    first, last = tables.get(0), tables.get(best)
    shown = []
    if first and last and first.keys() - {*PHASES, *TIPS}:
        caption = f"Dashed: before. Full: iteration {best}, which was verified."
        shown.append(Section("Waveforms", waveforms(first, last), caption))
    if first and last and TIPS[0] in first:
        caption = (
            f"How fast the tip of group A goes along its path, by the leg model: before, and with "
            f"iteration {best}."
        )
        shown.append(Section("Speed of the tip", speeds(first, last), caption))
    updated = {f"iteration {i}": table for i, table in tables.items() if i and table}
    if updated:
        caption = "How far the corrected phase ψ runs ahead of the commanded phase φ."
        shown.append(Section("Phase map", phase_maps(updated), caption))
    return shown


def _raw(run: RunData, named: Mapping[str, Mapping[str, Any]]) -> list[Section]:
    """Return what was read before any filter, of those recordings that are there."""
    sensor = run.result["sensor"]
    read = {name: run.residual(entry.get("recording", ""), sensor) for name, entry in named.items()}
    found = {name: residual for name, residual in read.items() if residual is not None}
    if not found:
        return []
    caption = "Every reading less a straight line: drift and noise included, nothing filtered."
    return [Section("Raw recordings", residuals(found), caption)]
