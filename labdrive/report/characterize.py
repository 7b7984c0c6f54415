"""The report of a `characterize` run."""

from labdrive.report.entries import STANDS_OUT
from labdrive.report.error_figures import error_with_band
from labdrive.report.harmonic_figures import harmonics
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable
from labdrive.report.sections import Fact, Section, errors_table, harmonics_table, measured
from labdrive.report.table_figures import residuals


def facts(run: RunData) -> list[Fact]:
    """Return the numbers to read first."""
    result, unit = run.result, run.result["unit"]
    error, floor = result["periodic_error"], result["noise_floor"]["rms"]
    shown = [
        Fact(readable(error["rms"], unit), "periodic error, rms"),
        Fact(readable(error["pv"], unit), "peak-to-valley"),
        Fact(readable(floor, unit), "noise floor, rms"),
    ]
    return [*shown, *_cycle(run)]


def _cycle(run: RunData) -> list[Fact]:
    cycle = run.result.get("cycle")
    if not cycle:
        return []
    told = measured(cycle["value"], cycle["standard_error"], cycle["unit"])
    return [Fact(told, "length of the cycle, fitted")]


def summary(run: RunData) -> str:
    """Return in words what happened."""
    result = run.result
    method = str(result.get("estimator", "unknown")).replace("_", " ")
    leading = max(result["harmonics"], key=lambda h: h["amplitude"], default=None)
    led = "" if leading is None else f" Harmonic {leading['k']} leads."
    return f"One recording by {result['sensor']}; estimator {method}. Nothing was changed.{led}"


def sections(run: RunData) -> list[Section]:
    """Return figures and tables, in reading order."""
    result, unit = run.result, run.result["unit"]
    label = str(result.get("label") or "recording")
    return [
        Section(
            "Periodic error over the phase",
            error_with_band(result, unit),
            "The harmonics of the cycle, with drift and noise between them left out.",
        ),
        errors_table("Numbers", {label: result}, unit),
        Section(
            "Harmonics",
            harmonics({"": result}, unit),
            f"Bars: one standard error. Hollow: within {STANDS_OUT:g} standard errors, as noise "
            "alone would be.",
        ),
        harmonics_table({"": result}, unit),
        *_raw(run, label),
    ]


def _raw(run: RunData, label: str) -> list[Section]:
    found = run.residual(run.result.get("recording", ""), run.result["sensor"])
    if found is None:
        return []
    caption = "Every reading less a straight line: drift and noise included, nothing filtered."
    return [Section("Raw recording", residuals({label: found}), caption)]
