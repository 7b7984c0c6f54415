"""Step size under rising load, for one table after another: what load and scaling sweeps share."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from labdrive.experiments.iterate import Loop, Stop
from labdrive.experiments.rolling_resistance import Unloaded, read_unloaded, refuse_other_unit
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.quantities import Force, InputFile
from labdrive.interfaces.settings import PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.recording import Recording, Sampling
from labdrive.model.units import format_si
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.cycle_mean import cycle_mean
from labdrive.periodic.estimate import estimate
from labdrive.periodic.load_curve import FEWEST_POINTS, LoadCurve, load_curve, stalled
from labdrive.periodic.measured import Measured


def _rising(loads: tuple[float, ...]) -> tuple[float, ...]:
    if loads[0] < 0 or any(b <= a for a, b in pairwise(loads)):
        raise ValueError("must rise from one to the next, beginning at 0 N or more")
    return loads


class LoadSettings(SettingsBase):
    """What sweeps over loads have in common."""

    loads: Annotated[tuple[Force, ...], AfterValidator(_rising)] = Field(
        min_length=FEWEST_POINTS, description="Rising. No further ones are set after a stall."
    )
    motion: MotionSettings
    sensor: SensorName = Field(description="The bench's sensor for the step size.")
    force_sensor: SensorName | None = Field(
        default=None, description="Reads the load; without, loads are what the bench set."
    )
    rolling_resistance_from: InputFile | None = Field(
        default=None,
        description="result.json of a rolling_resistance run, taken from what the force sensor "
        "reads.",
    )
    stall_within: Force = Field(
        default=1.0, gt=0, description="The stall load is narrowed down to this, by halving."
    )
    optimizer: Annotated[SettingsBase | None, PluginSlot("optimizers", key="use")] = Field(
        default=None, description="Optimizes each waveform first, without load; left out: as it is."
    )
    stop: Stop = Field(default_factory=Stop)


@dataclass(frozen=True)
class Subject:
    """A table to be loaded: `label` names it, `waveform` made it."""

    label: str
    waveform: Waveform
    table: WaveformTable

    @property
    def key(self) -> dict[str, Any]:
        """What names it in the result."""
        waveform = self.waveform
        return {
            "waveform": Path(waveform.trajectory).stem,
            "x_scale": waveform.x_scale,
            "y_scale": waveform.y_scale,
        }


@dataclass(frozen=True)
class Point:
    """A step size [`unit`] at a load [N]; `asked` is what the bench was asked to set [N]."""

    asked: float
    load: Measured
    step: Measured
    unit: str
    recording: str


@dataclass(frozen=True)
class Swept:
    """A subject with its points, in order of load, and what they say."""

    subject: Subject
    points: list[Point]
    curve: LoadCurve

    def point_entries(self) -> list[dict[str, Any]]:
        """Return `points` of the contract."""
        return [
            {
                **self.subject.key,
                "load": point.load.value,
                "load_standard_error": point.load.standard_error,
                "load_set": point.asked,
                "step_size": point.step.value,
                "standard_error": point.step.standard_error,
                "slipping": i >= self.curve.linear,
                "recording": point.recording,
            }
            for i, point in enumerate(self.points)
        ]

    def curve_entry(self) -> dict[str, Any]:
        """Return one of `curves` of the contract; `standard_error` is that of the stall load."""
        curve = self.curve
        return {
            **self.subject.key,
            "step_size": curve.unloaded.value,
            "step_size_standard_error": curve.unloaded.standard_error,
            "compliance": curve.compliance.value,
            "compliance_standard_error": curve.compliance.standard_error,
            "linear_points": curve.linear,
            "slip_onset": curve.slip_onset and curve.slip_onset.value,
            "slip_onset_standard_error": curve.slip_onset and curve.slip_onset.standard_error,
            "stall_load": curve.stall_load and curve.stall_load.value,
            "standard_error": curve.stall_load and curve.stall_load.standard_error,
        }


class LoadPoints:
    """Records points of load curves, by the settings of a sweep."""

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def planned(self, setup: Setup, subject: Subject) -> list[PlannedRecording]:
        """Return what a subject may need: its optimization, its loads, the halvings at the end."""
        settings = self._settings
        self._refuse_misfits(setup)
        motion, back = settings.motion.motion(), settings.motion.return_to_start
        points = len(settings.loads) + self._most_halvings()
        at_loads = PlannedRecording(
            subject.label, motion, subject.table, points, back, load=settings.loads[-1]
        )
        if settings.optimizer is None:
            return [at_loads]
        setup.optimizer(settings.optimizer, subject.table)
        return [self._loop().planned(subject.table, f"{subject.label} iteration"), at_loads]

    def sweep(self, bench: Bench, subject: Subject) -> Swept:
        """Optimize the subject if asked, load it until it stalls, narrow the stall load down."""
        bench.set_load(0.0)
        if self._settings.optimizer is not None:
            best = self._loop().run(bench, subject.table, subject.label).best
            subject = replace(subject, table=best.proposal.table)
        points: list[Point] = []
        for load in self._settings.loads:
            points.append(self._point(bench, subject, load))
            if self._stalled(points, points[-1]):
                self._narrow(bench, subject, points)
                break
        bench.set_load(0.0)
        points.sort(key=lambda point: point.asked)
        swept = Swept(subject, points, _curve(points))
        bench.note(_summary(swept))
        return swept

    def _narrow(self, bench: Bench, subject: Subject, points: list[Point]) -> None:
        """Halve the gap between the last load that was borne and the first that was not."""
        borne = max((p.asked for p in points if not self._stalled(points, p)), default=None)
        not_borne = points[-1].asked
        while borne is not None and not_borne - borne > self._settings.stall_within:
            point = self._point(bench, subject, (borne + not_borne) / 2)
            points.append(point)
            if self._stalled(points, point):
                not_borne = point.asked
            else:
                borne = point.asked

    def _stalled(self, points: Sequence[Point], point: Point) -> bool:
        return stalled(point.step.value, points[0].step.value)

    def _point(self, bench: Bench, subject: Subject, load: float) -> Point:
        settings = self._settings
        came_to = bench.set_load(load)
        recording = bench.record(
            settings.motion.motion(),
            subject.table,
            f"{subject.label} {format_si(load, 'N', 4)}",
            return_to_start=settings.motion.return_to_start,
        )
        polled = recording.sampling is Sampling.POLLED
        response = estimate(
            recording, settings.sensor, estimator="least_squares" if polled else "exact"
        )
        return Point(
            asked=load,
            load=self._load(recording, came_to),
            step=Measured(response.step_size, response.step_size_standard_error),
            unit=response.unit,
            recording=f"recordings/{recording.number:04d}.h5",
        )

    def _load(self, recording: Recording, came_to: float) -> Measured:
        """Return the load [N]: the force read less the rolling resistance, or what was set."""
        settings = self._settings
        if settings.force_sensor is None:
            return Measured(came_to, 0.0)
        force = cycle_mean(recording, settings.force_sensor)
        load = self._unloaded().load(force.value, recording.direction)
        return Measured(load, force.standard_error)

    def _unloaded(self) -> Unloaded:
        path = self._settings.rolling_resistance_from
        return Unloaded() if path is None else read_unloaded(path)

    def _loop(self) -> Loop:
        settings = self._settings
        return Loop(settings.motion, settings.sensor, settings.optimizer, settings.stop)

    def _most_halvings(self) -> int:
        """Return how often the widest gap between loads is halved."""
        widest = float(np.max(np.diff(self._settings.loads)))
        return max(0, math.ceil(math.log2(widest / self._settings.stall_within)))

    def _refuse_misfits(self, setup: Setup) -> None:
        settings = self._settings
        if not setup.has_load:
            message = "this bench has no `load` that could be set"
            raise InputError(Problem(message, "loads"))
        if settings.force_sensor is not None:
            refuse_other_unit(setup, settings.force_sensor, "force_sensor")
        elif settings.rolling_resistance_from is not None:
            message = (
                "rolling resistance is taken from a force sensor's readings; name force_sensor"
            )
            raise InputError(Problem(message, "rolling_resistance_from"))
        self._unloaded()


def result(kind: str, settings: Any, swept: Sequence[Swept]) -> Mapping[str, Any]:
    """Return the contract's `points` and `curves`, and what they were measured with."""
    return {
        "kind": kind,
        "unit": swept[0].points[0].unit,
        "sensor": settings.sensor,
        "force_sensor": settings.force_sensor,
        "rolling_resistance_from": str(settings.rolling_resistance_from or ""),
        "optimized": settings.optimizer is not None,
        "points": [entry for one in swept for entry in one.point_entries()],
        "curves": [one.curve_entry() for one in swept],
    }


def _curve(points: Sequence[Point]) -> LoadCurve:
    return load_curve(
        np.array([point.load.value for point in points]),
        np.array([point.step.value for point in points]),
        np.array([point.step.standard_error for point in points]),
    )


def _summary(swept: Swept) -> str:
    curve, unit = swept.curve, swept.points[0].unit
    stall = "not reached" if curve.stall_load is None else format_si(curve.stall_load.value, "N", 3)
    return (
        f"{swept.subject.label}: step {format_si(curve.unloaded.value, unit, 4)}, compliance "
        f"{format_si(curve.compliance.value, f'{unit}/N', 3)}, stall {stall}"
    )
