"""`optimize`: measure the periodic error, correct the phase, again until only noise is left."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.experiments.iterate import Loop, Stop, summary
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion


class Optimize:
    """Records, estimates, updates; verifies the best table on a recording no fit has seen."""

    class Settings(SettingsBase):
        """Settings of an optimization."""

        waveform: Waveform | None = Field(
            default=None, description="For actuators with a choice of waveform."
        )
        motion: MotionSettings
        sensor: SensorName = Field(description="The bench's sensor to linearize on.")
        optimizer: Annotated[SettingsBase, PluginSlot("optimizers", key="use")]
        stop: Stop = Field(default_factory=Stop)
        verification_factor: int = Field(
            default=4,
            ge=1,
            description="Samples per period of the verification, as a multiple of the motion's: "
            "harmonics beyond half the motion's samples would pass unseen otherwise.",
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings
        self._loop = Loop(settings.motion, settings.sensor, settings.optimizer, settings.stop)

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most this can come to: every iteration and the verification."""
        settings = self._settings
        if setup.fixed_motion is not None:
            raise InputError(Problem("a recording cannot be optimized; use characterize", "kind"))
        table = setup.nominal_table(settings.waveform)
        setup.optimizer(settings.optimizer, table)
        finer = self._verification_motion(setup)
        back = settings.motion.return_to_start
        return [
            self._loop.planned(table),
            PlannedRecording("verification", finer, table, 1, back),
        ]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Iterate, then verify the best table; return the contract's `optimize` result."""
        settings, setup = self._settings, bench.setup
        done = self._loop.run(bench, setup.nominal_table(settings.waveform))
        motion = self._verification_motion(setup)
        verified = self._loop.try_once(
            bench, done.optimizer, done.best.proposal, "verification", motion
        )
        improvement = done.iterations[0].rms / verified.rms
        bench.note(summary(verified))
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
        """Return the motion sampled as much finer as asked, or as the actuator can clock."""
        motion: Motion = self._settings.motion.motion()
        finest = setup.max_samples_per_period or motion.samples_per_period
        factor = self._settings.verification_factor
        while factor > 1 and motion.samples_per_period * factor > finest:
            factor //= 2
        return replace(motion, samples_per_period=motion.samples_per_period * factor)
