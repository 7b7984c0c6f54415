"""`optimize`: measure the periodic error, correct the phase, again until only noise is left."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.optimizer import Optimizer, Proposal
from labdrive.interfaces.settings import PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN
from labdrive.periodic.response import Response


class Stop(SettingsBase):
    """When to stop; that only noise is left always ends it."""

    max_iterations: int = Field(default=8, ge=1, description="Updates of the table, at most.")
    least_gain: float = Field(
        default=0.05,
        gt=0,
        lt=1,
        description="`converged` when an update lowers the rms of the periodic error by less than "
        "this share of the best so far.",
    )


@dataclass(frozen=True, eq=False)
class Iteration:
    """A proposal, what was recorded with it, and what that says."""

    proposal: Proposal
    recording: Recording
    response: Response

    @property
    def rms(self) -> float:
        """Root mean square of the periodic error, in the sensor's unit."""
        return self.response.periodic_error.rms


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

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most this can come to: every iteration and the verification."""
        settings = self._settings
        if setup.fixed_motion is not None:
            raise InputError(Problem("a recording cannot be optimized; use characterize", "kind"))
        table = setup.nominal_table(settings.waveform)
        setup.optimizer(settings.optimizer, table)
        motion, back = settings.motion.motion(), settings.motion.return_to_start
        finer = self._verification_motion(motion, setup)
        iterations = settings.stop.max_iterations + 1
        return [
            PlannedRecording("iteration", motion, table, iterations, back),
            PlannedRecording("verification", finer, table, 1, back),
        ]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Iterate, then verify the best table; return the contract's `optimize` result."""
        settings, setup = self._settings, bench.setup
        optimizer = setup.optimizer(settings.optimizer, setup.nominal_table(settings.waveform))
        iterations, stopped = self._iterate(bench, optimizer)
        best = min(range(len(iterations)), key=lambda i: iterations[i].rms)
        motion = self._verification_motion(settings.motion.motion(), setup)
        proposal = iterations[best].proposal
        verified = self._try(bench, optimizer, proposal, motion, "verification")
        improvement = iterations[0].rms / verified.rms
        bench.note(_summary(verified))
        bench.note(f"{improvement:.3g} times smaller, rms; stopped by {stopped}")
        return {
            "kind": "optimize",
            "unit": verified.response.unit,
            "sensor": settings.sensor,
            "iterations": [
                {"iteration": i, "table": _table_name(i), "remark": tried.proposal.remark}
                | entry(tried.response, tried.recording)
                for i, tried in enumerate(iterations)
            ],
            "stopped": stopped,
            "best_iteration": best,
            "verification": entry(verified.response, verified.recording),
            "improvement": improvement,
        }

    def _iterate(self, bench: Bench, optimizer: Optimizer) -> tuple[list[Iteration], str]:
        """Record and update until a reason to stop is found; return that reason as well."""
        motion, proposal = self._settings.motion.motion(), optimizer.first()
        iterations: list[Iteration] = []
        while True:
            number = len(iterations)
            tried = self._try(bench, optimizer, proposal, motion, f"iteration {number}")
            bench.keep_table(_table_name(number), _columns(proposal))
            bench.note(_summary(tried))
            iterations.append(tried)
            reason = stop_reason([i.rms for i in iterations], tried.response, self._settings.stop)
            if reason:
                return iterations, reason
            proposal = optimizer.next(proposal, tried.response)

    def _try(
        self, bench: Bench, optimizer: Optimizer, proposal: Proposal, motion: Motion, label: str
    ) -> Iteration:
        settings = self._settings
        recording = bench.record(
            motion, proposal.table, label, return_to_start=settings.motion.return_to_start
        )
        return Iteration(proposal, recording, optimizer.estimate(recording, settings.sensor))

    def _verification_motion(self, motion: Motion, setup: Setup) -> Motion:
        """Return the motion sampled as much finer as asked, or as the actuator can clock."""
        finest = setup.max_samples_per_period or motion.samples_per_period
        factor = self._settings.verification_factor
        while factor > 1 and motion.samples_per_period * factor > finest:
            factor //= 2
        return replace(motion, samples_per_period=motion.samples_per_period * factor)


def stop_reason(rms: list[float], response: Response, stop: Stop) -> str:
    """Return why to stop after the last of `rms` [sensor's unit], which `response` gave; or ""."""
    if not response.significant().any():
        return "noise_floor"
    if len(rms) > 1 and rms[-1] > (1 - stop.least_gain) * min(rms[:-1]):
        return "converged"
    return "max_iterations" if len(rms) > stop.max_iterations else ""


def _table_name(iteration: int) -> str:
    return f"iteration-{iteration:02d}"


def _columns(proposal: Proposal) -> dict[str, FloatArray]:
    table = proposal.table
    phase = TURN * np.arange(table.length) / table.length
    outputs = {f"{channel.name}_{channel.unit}": channel.samples for channel in table.channels}
    return {"phase_rad": phase, "psi_rad": proposal.phase_map(phase), **outputs}


def _summary(tried: Iteration) -> str:
    error, response = tried.response.periodic_error, tried.response
    return (
        f"{tried.recording.label}: periodic error {format_si(error.rms, response.unit, 3)} rms, "
        f"{format_si(error.pv, response.unit, 3)} peak-to-valley; noise floor "
        f"{format_si(response.noise_floor_rms, response.unit, 3)} rms"
    )
