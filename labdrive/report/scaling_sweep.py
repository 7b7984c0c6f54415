"""The report of a `scaling_sweep` run: the paper's Figure 3."""

from collections.abc import Mapping
from typing import Any

from labdrive.model.arrays import FloatArray
from labdrive.report.load_figures import Key, key_of, load_curves, trajectories
from labdrive.report.load_sections import curves_table, points_table, read_how
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable, significant
from labdrive.report.sections import Fact, Section

AXES = {"x": "x scaled", "y": "y scaled", "both": "both scaled"}


def facts(run: RunData) -> list[Fact]:
    """Return what is left of the stall load at the smallest scale of each way."""
    return [
        Fact(
            _share(trend["stall_shares"][-1]),
            f"of the stall load, {AXES[axes]} to {trend['scales'][-1]:g}",
        )
        for axes, trend in run.result["trends"].items()
    ]


def _share(share: float | None) -> str:
    return "unknown" if share is None else f"{share:.0%}"


def summary(run: RunData) -> str:
    """Return in words what was done, and what became of the pretension."""
    changes = [curve["pretension_change"] for curve in run.result["curves"]]
    largest = max((abs(change) for change in changes if change is not None), default=None)
    if largest is None:
        pretension = "Nothing is known of the pretension: the actuator has no leg model."
    elif largest < 1e-12:
        pretension = "Voltages were raised so that the rod is held as high, in the mean, as before."
    else:
        low = min(change for change in changes if change is not None)
        pretension = (
            f"Voltages swing about the same middle, so the rod is held up to "
            f"{readable(-low, 'm')} lower in the mean, and the leaf spring is tensed less."
        )
    return f"{read_how(run.result)} {pretension}"


def sections(run: RunData) -> list[Section]:
    """Return figures and tables."""
    result = run.result
    caption = "Dotted: x scaled. Full: y scaled. Dashed: both. Bars: one standard error."
    shown = [Section("Step size over load", load_curves(result), caption)]
    tables = scaled_tables(run)
    if tables:
        text = "Paths of a leg's tip by the linear model; dotted, full and dashed as above."
        shown.append(Section("Trajectories", trajectories(tables), text))
    return [*shown, _trends(result), curves_table(result), points_table(result)]


def scaled_tables(run: RunData) -> dict[Key, Mapping[str, FloatArray]]:
    """Return the tables of the scaled waveforms, where they tell of tips."""
    found = {key_of(c): run.table(c.get("table", "")) for c in run.result["curves"]}
    return {key: table for key, table in found.items() if "x_A_m" in table}


def _trends(result: Mapping[str, Any]) -> Section:
    """Return how step and stall load go with the scale."""
    unit, trends = result["unit"], result["trends"]
    rows = [
        [AXES[axes], f"{scale:g}", readable(step, unit, 4), _share(share)]
        for axes, trend in trends.items()
        for scale, step, share in zip(
            trend["scales"], trend["step_sizes"], trend["stall_shares"], strict=True
        )
    ]
    head = ["", "scale", "step at the least load", "stall load, of the unscaled"]
    lines = "; ".join(f"{AXES[axes]}: {_line(trend, unit)}" for axes, trend in trends.items())
    return Section("With the scale", head=head, rows=rows, caption=f"As straight lines: {lines}.")


def _line(trend: Mapping[str, Any], unit: str) -> str:
    sign = "+" if trend["intercept"] > 0 else "−"
    return (
        f"{readable(trend['slope'], unit)} · scale {sign} "
        f"{readable(abs(trend['intercept']), unit)} (R² {significant(trend['r_squared'], 5)})"
    )
