"""`identify_legs`: the linear model of the legs, and their hysteresis (paper, Figure 2a and b)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.legs_file import Hysteresis, LegsFile
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import TURN, WaveformTable
from labdrive.periodic.hysteresis import PlayModel
from labdrive.periodic.leg_fit import AxisFit, Geometry, fit_axis, fit_plays
from labdrive.periodic.phase_map import node_phases

LEGS_FILE = "legs.json"
CHANNELS = 4


class IdentifyLegs:
    """Drives both groups in tandem, so that the rod goes where the tips go, and fits the model."""

    class Settings(SettingsBase):
        """Settings of the identification."""

        waveform: Waveform = Field(description="The path of the tips; the paper's is the ellipse.")
        motion: MotionSettings
        x_sensor: SensorName = Field(description="Sees the rod along the travel.")
        y_sensor: SensorName = Field(description="Sees the rod across the travel.")
        geometry: Geometry = Field(
            default="bending",
            description="bending: m12 = -m11, m22 = m21. clamp_shear: m11 = m22 = 0. stack: two "
            "stacks in a V. free: four coefficients.",
        )
        plays: int = Field(default=8, ge=1, le=32, description="Of the hysteresis model.")

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the one recording there will be."""
        settings = self._settings
        table = tandem(setup.nominal_table(settings.waveform))
        if setup.sampling is Sampling.POLLED:
            message = "the tips' path is averaged entry by entry; take sensors that are triggered"
            raise InputError(Problem(message, "x_sensor", got=settings.x_sensor))
        for field in ("x_sensor", "y_sensor"):
            sensor = getattr(settings, field)
            if setup.sensor_unit(sensor) != "m":
                raise InputError(Problem("a sensor of length is due", field, got=sensor))
        back = settings.motion.return_to_start
        return [PlannedRecording("tandem", settings.motion.motion(), table, 1, back)]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Record and fit; write the legs' file; return the contract's `identify_legs` result."""
        settings = self._settings
        (planned,) = self.plan(bench.setup)
        table = tandem(bench.setup.nominal_table(settings.waveform))
        recording = bench.record(
            planned.motion, table, planned.label, return_to_start=planned.return_to_start
        )
        phase = recording.phase[: recording.samples_per_period]
        U0, U1 = (channel.at(phase) for channel in table.channels[:2])
        sensors = {"x": settings.x_sensor, "y": settings.y_sensor}
        fits = {
            axis: fit_axis(_cycles(recording, sensor), U0, U1, settings.geometry, axis)
            for axis, sensor in sensors.items()
        }
        plays = fit_plays(fits, U0, U1, settings.plays)
        file = _legs_file(bench.run, settings.geometry, fits, plays)
        bench.keep_file(LEGS_FILE, file.text())
        bench.keep_table("tips", _columns(phase, U0, U1, fits))
        widths = ", ".join(f"{axis} {fit.loop_width:.1%}" for axis, fit in fits.items())
        bench.note(f"hysteresis loops, of the stroke: {widths}")
        return _result(settings.geometry, sensors, fits, plays)


def tandem(table: WaveformTable) -> WaveformTable:
    """Return the table with every group in step with the first: the rod rides on all legs.

    InputError for actuators that have no legs.
    """
    if len(table.channels) != CHANNELS or {c.unit for c in table.channels} != {"V"}:
        message = "this actuator has no legs: two groups of two voltages are due"
        raise InputError(Problem(message, "kind"))
    phase = node_phases(table.length)
    return table.with_samples(tuple(c.at(phase - c.group_phase) for c in table.channels))


def _cycles(recording: Recording, sensor: str) -> FloatArray:
    """Return a reading cycle by cycle, less its line, shape (periods, samples per period)."""
    samples = recording.samples_per_period * recording.periods
    reading = recording.readings[sensor][:samples]
    turns = recording.phase[:samples] / TURN
    means = reading.reshape(recording.periods, -1).mean(axis=1)
    centres = turns.reshape(recording.periods, -1).mean(axis=1)
    drift = np.polyfit(centres, means, 1) if recording.periods > 1 else [0.0, means[0]]
    return np.asarray((reading - np.polyval(drift, turns)).reshape(recording.periods, -1))


def _legs_file(
    run: str, geometry: Geometry, fits: Mapping[str, AxisFit], plays: PlayModel
) -> LegsFile:
    (m11, m12), (m21, m22) = ([c.value for c in fits[axis].coefficients] for axis in "xy")
    return LegsFile(
        run=run,
        geometry=geometry,
        m11=m11,
        m12=m12,
        m21=m21,
        m22=m22,
        hysteresis=Hysteresis(
            radii_v=tuple(plays.radii.tolist()), weights=tuple(plays.weights.tolist())
        ),
    )


def _columns(
    phase: FloatArray, U0: FloatArray, U1: FloatArray, fits: Mapping[str, AxisFit]
) -> dict[str, FloatArray]:
    columns = {"phase_rad": phase, "U0_V": U0, "U1_V": U1}
    for axis, fit in fits.items():
        columns |= {
            f"{axis}_m": fit.mean,
            f"{axis}_model_m": fit.model,
            f"{axis}_drive_V": fit.drive,
        }
    return columns


def _result(
    geometry: Geometry,
    sensors: Mapping[str, str],
    fits: Mapping[str, AxisFit],
    plays: PlayModel,
) -> dict[str, Any]:
    result: dict[str, Any] = {
        "kind": "identify_legs",
        "unit": "m",
        "sensors": dict(sensors),
        "geometry": geometry,
        "matrix": [[c.value for c in fits[axis].coefficients] for axis in "xy"],
        "matrix_standard_error": [
            [c.standard_error for c in fits[axis].coefficients] for axis in "xy"
        ],
        "r_squared": {axis: fit.r_squared for axis, fit in fits.items()},
        "hysteresis": max(fit.loop_width for fit in fits.values()),
        "loop_width": {axis: fit.loop_width for axis, fit in fits.items()},
        "plays": {"radii": plays.radii.tolist(), "weights": plays.weights.tolist()},
        "drives": {axis: _drive(fit) for axis, fit in fits.items()},
        "legs_file": LEGS_FILE,
        "table": "tips",
    }
    return result | ({"stack": _stack(fits)} if geometry == "stack" else {})


def _drive(fit: AxisFit) -> str:
    """Return the combination of voltages that drives an axis, as `U0 − U1`."""
    first, second = (coefficient.value for coefficient in fit.coefficients)
    largest = max(abs(first), abs(second))
    terms = [(first / largest, "U0"), (second / largest, "U1")]
    parts = [
        f"{'−' if share < 0 else '+'} {'' if abs(share) == 1 else f'{abs(share):.3g} '}{name}"
        for share, name in terms
        if share
    ]
    return " ".join(parts).removeprefix("+ ")


def _stack(fits: Mapping[str, AxisFit]) -> dict[str, float]:
    """Return what two stacks in a V are: expansion of each [m/V], half the angle between [rad].

    Stacks at +-angle to y that grow by d0 and d1 bring the tip to x = (d0 - d1) / (2 sin angle),
    y = (d0 + d1) / (2 cos angle).
    """
    x, y = (fits[axis].coefficients[0].value for axis in "xy")
    angle = float(np.arctan2(abs(y), abs(x)))
    return {"angle": angle, "expansion": 2 * abs(x) * float(np.sin(angle))}
