"""`scaling_sweep`: step size against load for scaled trajectories (paper, Figure 3)."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from labdrive.experiments.iterate import columns
from labdrive.experiments.load_points import LoadPoints, LoadSettings, Subject, Swept, result
from labdrive.experiments.waveform_list import in_place_of
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.optimizer import Proposal
from labdrive.interfaces.waveform import Waveform
from labdrive.periodic.legs import carried_height
from labdrive.periodic.phase_map import PhaseMap

Axes = Literal["x", "y", "both"]


class ScalingSweep:
    """Scales one waveform along x, along y and along both, and loads it each time."""

    class Settings(LoadSettings):
        """Settings of the sweep."""

        waveform: Waveform
        axes: tuple[Axes, ...] = Field(default=("x", "y", "both"), min_length=1)
        scales: tuple[float, ...] = Field(
            default=(0.8, 0.6, 0.4), min_length=1, description="Each above 0 and below 1."
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings
        self._points = LoadPoints(settings)

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most that every scale may need."""
        subjects = self._subjects(setup)
        return [planned for one in subjects for planned in self._points.planned(setup, one)]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Sweep scale after scale; return the contract's `scaling_sweep` result."""
        setup = bench.setup
        subjects = self._subjects(setup)
        for subject in subjects:
            proposal = Proposal(subject.table, PhaseMap.identity())
            bench.keep_table(_table_name(subject), columns(proposal, setup))
        swept = [self._points.sweep(bench, one) for one in subjects]
        raised = _raised(setup, subjects)
        found = dict(result("scaling_sweep", self._settings, swept))
        found["curves"] = [
            {**curve, "pretension_change": rise, "table": _table_name(subject)}
            for curve, rise, subject in zip(found["curves"], raised, subjects, strict=True)
        ]
        return found | {"trends": dict(_trends(swept))}

    def _subjects(self, setup: Setup) -> list[Subject]:
        """Return the unscaled waveform and each scaled one."""
        return [_subject(setup, waveform) for waveform in self._scaled()]

    def _scaled(self) -> Iterator[Waveform]:
        settings = self._settings
        yield settings.waveform
        for axes in settings.axes:
            for scale in settings.scales:
                x, y = (scale if axes in {axis, "both"} else 1.0 for axis in "xy")
                waveform = settings.waveform
                scaled = {"x_scale": waveform.x_scale * x, "y_scale": waveform.y_scale * y}
                yield waveform.model_copy(update=scaled)


def _subject(setup: Setup, waveform: Waveform) -> Subject:
    with in_place_of("waveform.y_scale", "scales"):
        table = setup.nominal_table(waveform)
    name = Path(waveform.trajectory).stem
    return Subject(f"{name} {waveform.x_scale:g} x {waveform.y_scale:g}", waveform, table)


def _table_name(subject: Subject) -> str:
    return f"{subject.label.replace(' ', '-')}-nominal"


def _raised(setup: Setup, subjects: Sequence[Subject]) -> list[float | None]:
    """Return how much higher than unscaled each waveform holds the rod [m], by the leg model.

    It is what tenses the leaf spring that presses legs and rod together.
    """
    tips = [setup.tips(subject.table) for subject in subjects]
    heights = [carried_height(tip) if tip else None for tip in tips]
    return [None if h is None or heights[0] is None else h - heights[0] for h in heights]


def _trends(swept: Sequence[Swept]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield, for each way of scaling, how step and stall load go with the scale."""
    full = swept[0]
    for axes in ("x", "y", "both"):
        of_axes = [full, *(one for one in swept[1:] if _axes(one, full) == axes)]
        if len(of_axes) > 1:
            yield axes, _trend(axes, of_axes)


def _axes(one: Swept, full: Swept) -> str:
    """Return which way a sweep's waveform is scaled."""
    same_x = one.subject.waveform.x_scale == full.subject.waveform.x_scale
    same_y = one.subject.waveform.y_scale == full.subject.waveform.y_scale
    return "y" if same_x else "x" if same_y else "both"


def _trend(axes: str, swept: Sequence[Swept]) -> dict[str, Any]:
    """Return step sizes over the scale as a line, and stall loads as shares of the unscaled."""
    axis = "y" if axes == "y" else "x"
    scale = (
        np.array([one.subject.key[f"{axis}_scale"] for one in swept])
        / (swept[0].subject.key[f"{axis}_scale"])
    )
    step = np.array([one.points[0].step.value for one in swept])
    slope, intercept = np.polyfit(scale, step, 1)
    residual = step - (slope * scale + intercept)
    scatter = step - step.mean()
    stalls = [one.curve.stall_load for one in swept]
    unscaled = stalls[0]
    return {
        "scales": scale.tolist(),
        "step_sizes": step.tolist(),
        "slope": float(slope),
        "intercept": float(intercept),
        "r_squared": float(1 - (residual @ residual) / (scatter @ scatter)),
        "stall_shares": [
            None if stall is None or unscaled is None else stall.value / unscaled.value
            for stall in stalls
        ],
    }
