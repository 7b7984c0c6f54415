"""The report of a `load_sweep` run: the paper's Figure 2c."""

from labdrive.report.load_figures import key_of, load_curves, name_of
from labdrive.report.load_sections import curves_table, points_table, read_how
from labdrive.report.run_data import RunData
from labdrive.report.scale import readable
from labdrive.report.sections import Fact, Section


def facts(run: RunData) -> list[Fact]:
    """Return step and stall load of each waveform."""
    unit = run.result["unit"]
    return [
        Fact(
            f"{readable(curve['step_size'], unit)}, {_stall(curve['stall_load'])}",
            f"{name_of(key_of(curve))}: unloaded step, stall load",
        )
        for curve in run.result["curves"]
    ]


def _stall(force: float | None) -> str:
    return "no stall" if force is None else readable(force, "N")


def summary(run: RunData) -> str:
    """Return in words what was done."""
    result = run.result
    optimized = "each optimized first" if result["optimized"] else "as they are"
    count = len(result["points"])
    return f"{count} loads and waveforms were tried, waveforms {optimized}. {read_how(result)}"


def sections(run: RunData) -> list[Section]:
    """Return figure and tables."""
    caption = "Bars: one standard error. Strokes on the axis: stall loads."
    return [
        Section("Step size over load", load_curves(run.result), caption),
        curves_table(run.result),
        points_table(run.result),
    ]
