"""`optimize`: measure the periodic error, correct the phase, again until only noise is left."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.experiments.iterate import Loop, LoopSettings, finer, refuse_recordings, summary
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.waveform import Waveform
from labdrive.model.motion import Motion


class Optimize:
    """Records, estimates, updates; verifies the best table on a recording no fit has seen."""

    class Settings(LoopSettings):
        """Settings of an optimization."""

        waveform: Waveform | None = Field(
            default=None, description="For actuators with a choice of waveform."
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings
        self._loop = Loop(settings.motion, settings.sensor, settings.optimizer, settings.stop)

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most this can come to: every iteration and the verification."""
        settings = self._settings
        refuse_recordings(setup)
        table = setup.nominal_table(settings.waveform)
        setup.optimizer(settings.optimizer, table)
        motion, back = self._verification_motion(setup), settings.motion.return_to_start
        return [
            self._loop.planned(table),
            PlannedRecording("verification", motion, table, 1, back),
        ]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Iterate, then verify the best table; return the contract's `optimize` result."""
        settings, setup = self._settings, bench.setup
        done = self._loop.run(bench, setup.nominal_table(settings.waveform))
        motion = self._verification_motion(setup)
        verified = self._loop.try_once(bench, done, done.best.proposal, "verification", motion)
        improvement = done.iterations[0].rms / verified.rms
        bench.note(summary("verification", verified.response))
        bench.note(f"{improvement:.3g} times smaller, rms; stopped by {done.stopped}")
        return {
            "kind": "optimize",
            "unit": verified.response.unit,
            "sensor": settings.sensor,
            **done.result(),
            "verification": entry(verified.response, verified.recording),
            "improvement": improvement,
        }

    def _verification_motion(self, setup: Setup) -> Motion:
        settings = self._settings
        return finer(settings.motion.motion(), setup, settings.verification_factor)
