"""The report of a `characterize` run."""

from labdrive.report import figures
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, significant
from labdrive.report.sections import Fact, Section, errors_row, harmonics_table


def facts(run: RunData) -> list[Fact]:
    """Return the numbers to read first."""
    result, unit = run.result, run.result["unit"]
    error, floor = result["periodic_error"], result["noise_floor"]["rms"]
    shown = [
        Fact(readable(error["rms"], unit), "periodic error, rms"),
        Fact(readable(error["pv"], unit), "peak-to-valley"),
        Fact(readable(floor, unit), "noise floor, rms"),
    ]
    cycle = result.get("cycle")
    if cycle:
        told = f"{cycle['value']:.6g} ± {significant(cycle['standard_error'], 2)} {cycle['unit']}"
        shown.append(Fact(told, "length of the cycle, fitted"))
    return shown


def summary(run: RunData) -> str:
    """Return in words what happened."""
    result = run.result
    return (
        f"One recording of {result['sensor']}, estimated by {result['estimator']}; nothing was "
        "changed."
    )


def sections(run: RunData) -> list[Section]:
    """Return figures and tables, in reading order."""
    result, unit = run.result, run.result["unit"]
    shown = [
        Section(
            "Periodic error over the phase",
            figures.error_with_band(result, unit),
            "Filtered to the harmonics of the cycle.",
        ),
        Section(
            "Harmonics",
            figures.harmonics({"amplitude": result}, unit),
            "Bars are one standard error.",
        ),
    ]
    read = run.reading(result["recording"], result["sensor"])
    if read is not None:
        caption = "As read, unfiltered, less a straight line: drift and noise included."
        drawn = figures.residuals({result["label"]: read}, unit)
        shown.append(Section("Raw recording", drawn, caption))
    head = ("", "step size", "rms", "peak-to-valley", "noise floor, rms")
    shown.append(Section("Numbers", head=head, rows=[errors_row(result["label"], result, unit)]))
    return [*shown, harmonics_table(result, unit)]
