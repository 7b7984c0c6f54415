"""The report of an `optimize_drives` run."""

from labdrive.report.error_figures import convergence
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, significant
from labdrive.report.sections import Fact, Section, errors_table, ratio


def facts(run: RunData) -> list[Fact]:
    """Return the improvement of each drive."""
    return [
        Fact(
            f"{readable(drive['iterations'][0]['periodic_error']['rms'], drive['unit'])} → "
            f"{readable(drive['verification']['periodic_error']['rms'], drive['unit'])}",
            f"{drive['actuator']}: periodic error, rms",
        )
        for drive in run.result["drives"]
    ]


def summary(run: RunData) -> str:
    """Return in words how it was done."""
    how = "in step" if run.result["order"] == "together" else "one after the other"
    return (
        f"The drives were optimized {how}, and verified in one walk of all of them. Cross-talk is "
        "what a sensor saw while one drive moved alone."
    )


def sections(run: RunData) -> list[Section]:
    """Return convergence and numbers of each drive, and the cross-talk."""
    shown = [_cross_talk(run)]
    for drive in run.result["drives"]:
        unit, name = drive["unit"], drive["actuator"]
        rows = {str(entry["iteration"]): entry for entry in drive["iterations"]}
        rows["verification"] = drive["verification"]
        figure = convergence(drive["iterations"], drive["verification"], unit)
        shown += [
            Section(f"{name}: convergence", figure.replace("convergence-", f"convergence-{name}-")),
            errors_table(f"{name}: iterations", rows, unit),
        ]
    return shown


def _cross_talk(run: RunData) -> Section:
    unit = run.result["unit"]
    rows = [
        [
            entry["moved"],
            entry["sensor"],
            _permille(entry["share"], entry["share_standard_error"]),
            readable(entry["periodic_error"]["rms"], unit),
            ratio(entry["periodic_error"]["rms"], entry["noise_floor"]["rms"]),
        ]
        for entry in run.result["cross_talk"]
    ]
    head = ["moved alone", "seen by", "share of the travel", "periodic error, rms", "/ noise floor"]
    return Section("Cross-talk", head=head, rows=rows)


def _permille(share: float, error: float) -> str:
    return f"{significant(1e3 * share, 4)} ± {significant(1e3 * error, 2)} ‰"
