"""`characterize`: one recording, one estimate of the periodic error, nothing changed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import TURN
from labdrive.periodic.cycle import CycleFit, fit_cycle
from labdrive.periodic.estimate import estimate

# Enough to pin the length of a cycle down; more would only make the search finer.
CYCLE_HARMONICS = 3


class Characterize:
    """Records once and estimates; where asked, fits the length of the cycle as well."""

    class Settings(SettingsBase):
        """Settings of a characterization."""

        waveform: Waveform | None = Field(
            default=None, description="For actuators with a choice of waveform."
        )
        motion: MotionSettings | None = Field(
            default=None, description="Required where something moves; a recording has its own."
        )
        sensor: SensorName = Field(description="The bench's sensor to characterize with.")
        estimator: Literal["exact", "paper", "least_squares"] = Field(
            default="exact", description="least_squares: on real phases, for recordings."
        )
        drift_order: int = Field(
            default=1, ge=0, le=8, description="For least_squares: polynomial drift removed."
        )
        harmonics: int | None = Field(
            default=None, ge=1, description="Highest harmonic; all there are by default."
        )
        fit_cycle: bool = Field(
            default=False, description="Fit the cycle's length near the one the bench gives."
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the one recording there will be."""
        estimator = self._settings.estimator
        if setup.sampling is Sampling.POLLED and estimator != "least_squares":
            message = "phases will not be equidistant on this bench; use least_squares"
            raise InputError(Problem(message, field="estimator", got=estimator))
        back = self._settings.motion is not None and self._settings.motion.return_to_start
        table = setup.nominal_table(self._settings.waveform)
        return [PlannedRecording("characterization", self._motion(setup), table, 1, back)]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Record and estimate; return the contract's `characterize` result."""
        settings = self._settings
        (planned,) = self.plan(bench.setup)
        recording = bench.record(
            planned.motion, planned.table, planned.label, return_to_start=planned.return_to_start
        )
        result: dict[str, Any] = {
            "kind": "characterize",
            "sensor": settings.sensor,
            "estimator": settings.estimator,
        }
        if settings.fit_cycle:
            cycle = self._fitted_cycle(recording)
            result["cycle"] = _cycle_entry(recording, cycle)
            recording = replace(recording, phase=recording.phase * (TURN / cycle.period))
        response = estimate(
            recording,
            settings.sensor,
            estimator=settings.estimator,
            drift_order=settings.drift_order,
            harmonics=settings.harmonics,
        )
        return result | {"unit": response.unit} | entry(response, recording)

    def _motion(self, setup: Setup) -> Motion:
        """Return the recipe's motion, or the only one a recording has."""
        given = self._settings.motion
        if setup.fixed_motion is not None:
            if given is not None:
                message = "a recording has a motion of its own; leave this out"
                raise InputError(Problem(message, field="motion"))
            return setup.fixed_motion
        if given is None:
            raise InputError(Problem("missing: this actuator moves", field="motion"))
        motion: Motion = given.motion()
        return motion

    def _fitted_cycle(self, recording: Recording) -> CycleFit:
        """Return the cycle that fits best, in rad of the nominal phase."""
        settings = self._settings
        return fit_cycle(
            recording.phase,
            recording.readings[settings.sensor],
            guess=TURN,
            drift_order=settings.drift_order,
            harmonics=min(settings.harmonics or CYCLE_HARMONICS, CYCLE_HARMONICS),
        )


def _cycle_entry(recording: Recording, cycle: CycleFit) -> dict[str, Any]:
    """Return the fitted cycle in s, as the nominal one was given by time or is walked in it."""
    seconds = float(np.ptp(recording.time) / np.ptp(recording.phase))
    return {
        "value": cycle.period * seconds,
        "standard_error": cycle.standard_error * seconds,
        "unit": "s",
    }
