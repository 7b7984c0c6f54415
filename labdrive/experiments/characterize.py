"""`characterize`: one recording, one estimate of the periodic error, nothing changed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN
from labdrive.periodic.cycle import CycleFit, fit_cycle
from labdrive.periodic.estimate import estimate


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
        sensor: str = Field(description="The bench's sensor to characterize with.")
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

    def __init__(self, settings: Any) -> None:  # noqa: ANN401
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the one recording there will be."""
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
        fitted = self._fitted_cycle(recording) if settings.fit_cycle else None
        response = estimate(
            recording if fitted is None else _rephased(recording, fitted),
            settings.sensor,
            estimator=settings.estimator,
            drift_order=settings.drift_order,
            harmonics=settings.harmonics,
        )
        result = {"kind": "characterize", "unit": response.unit, "sensor": settings.sensor}
        result |= {"estimator": settings.estimator} | entry(response, recording)
        return result
