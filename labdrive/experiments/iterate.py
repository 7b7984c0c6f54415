"""The loop that optimizing is: record, estimate, update, until only noise is left."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup, Tables
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.optimizer import Optimizer, Proposal
from labdrive.interfaces.settings import PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN, WaveformTable
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


class LoopSettings(SettingsBase):
    """What recipes that optimize and verify have in common."""

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


@dataclass(frozen=True, eq=False)
class Optimized:
    """All iterations of a loop, why it stopped, and the optimizer that led it."""

    optimizer: Optimizer
    iterations: list[Iteration]
    stopped: str
    prefix: str

    @property
    def best_iteration(self) -> int:
        """Number of the iteration with the smallest periodic error, rms."""
        return min(range(len(self.iterations)), key=lambda i: self.iterations[i].rms)

    @property
    def best(self) -> Iteration:
        """That iteration."""
        return self.iterations[self.best_iteration]

    def result(self) -> dict[str, Any]:
        """Return `iterations`, `stopped` and `best_iteration` of the contract."""
        return {
            "iterations": [
                {
                    "iteration": i,
                    "table": table_name(self.prefix, i),
                    "remark": tried.proposal.remark,
                }
                | entry(tried.response, tried.recording)
                for i, tried in enumerate(self.iterations)
            ],
            "stopped": self.stopped,
            "best_iteration": self.best_iteration,
        }


class Tuner:
    """Leads one optimizer from recording to recording, until there is a reason to stop."""

    def __init__(self, optimizer: Optimizer, sensor: str, stop: Stop, prefix: str = "") -> None:
        self._optimizer = optimizer
        self._sensor = sensor
        self._stop = stop
        self._prefix = prefix
        self._iterations: list[Iteration] = []
        self.proposal = optimizer.first()
        self.stopped = ""

    @property
    def label(self) -> str:
        """What the next recording is called."""
        return f"{self._prefix} iteration {len(self._iterations)}".lstrip()

    def take(self, bench: Bench, setup: Setup, recording: Recording) -> None:
        """Estimate from a recording of the proposal, keep its table, propose the next or stop."""
        bench.keep_table(
            table_name(self._prefix, len(self._iterations)), columns(self.proposal, setup)
        )
        response = self._optimizer.estimate(recording, self._sensor)
        tried = Iteration(self.proposal, recording, response)
        bench.note(summary(self.label, response))
        self._iterations.append(tried)
        rms = [iteration.rms for iteration in self._iterations]
        self.stopped = stop_reason(rms, tried.response, self._stop)
        if self.stopped:
            self.proposal = self.optimized.best.proposal
        else:
            self.proposal = self._optimizer.next(self.proposal, tried.response)

    @property
    def optimized(self) -> Optimized:
        """What came of it so far."""
        return Optimized(self._optimizer, self._iterations, self.stopped, self._prefix)


@dataclass(frozen=True)
class Loop:
    """What a recipe says of its loops; `optimizer` holds the settings of the one it names.

    `actuator` is the one to drive, None for the recipe's.
    """

    motion: MotionSettings
    sensor: str
    optimizer: Any
    stop: Stop
    actuator: str | None = None

    def planned(self, table: WaveformTable, label: str = "iteration") -> PlannedRecording:
        """Return what a loop that starts with `table` may record."""
        back = self.motion.return_to_start
        return PlannedRecording(
            label, self.motion.motion(), self.tables(table), self.stop.max_iterations + 1, back
        )

    def tables(self, table: WaveformTable) -> Tables:
        """Return what is to be played so that the loop's actuator plays `table`."""
        return table if self.actuator is None else {self.actuator: table}

    def run(self, bench: Bench, nominal: WaveformTable, prefix: str = "") -> Optimized:
        """Record and update until a reason to stop is found.

        Labels of recordings and names of tables begin with `prefix`.
        """
        setup = bench.setup if self.actuator is None else bench.setup.of(self.actuator)
        tuner = Tuner(setup.optimizer(self.optimizer, nominal), self.sensor, self.stop, prefix)
        while not tuner.stopped:
            tuner.take(bench, setup, self.record(bench, tuner.proposal.table, tuner.label))
        return tuner.optimized

    def try_once(
        self, bench: Bench, done: Optimized, proposal: Proposal, label: str, motion: Motion
    ) -> Iteration:
        """Record a proposal over another motion, and estimate as the optimizer does."""
        recording = self.record(bench, proposal.table, label, motion)
        return Iteration(proposal, recording, done.optimizer.estimate(recording, self.sensor))

    def record(
        self, bench: Bench, table: WaveformTable, label: str, motion: Motion | None = None
    ) -> Recording:
        """Record a table over the recipe's motion, or another."""
        return bench.record(
            motion or self.motion.motion(),
            self.tables(table),
            label,
            return_to_start=self.motion.return_to_start,
        )


def finer(motion: Motion, setup: Setup, factor: int) -> Motion:
    """Return the motion sampled `factor` times as fine, or as the actuator can clock."""
    finest = setup.max_samples_per_period or motion.samples_per_period
    while factor > 1 and motion.samples_per_period * factor > finest:
        factor //= 2
    return replace(motion, samples_per_period=motion.samples_per_period * factor)


def refuse_recordings(setup: Setup) -> None:
    """Raise InputError on a bench whose actuator is a recording: nothing there can be changed."""
    if setup.fixed_motion is not None:
        raise InputError(Problem("a recording cannot be optimized; use characterize", "kind"))


def stop_reason(rms: list[float], response: Response, stop: Stop) -> str:
    """Return why to stop after the last of `rms` [sensor's unit], which `response` gave; or ""."""
    if not response.significant().any():
        return "noise_floor"
    if len(rms) > 1 and rms[-1] > (1 - stop.least_gain) * min(rms[:-1]):
        return "converged"
    return "max_iterations" if len(rms) > stop.max_iterations else ""


def table_name(prefix: str, iteration: int) -> str:
    """Return the name under which an iteration's table is kept."""
    return f"{prefix} iteration {iteration:02d}".strip().replace(" ", "-")


def columns(proposal: Proposal, setup: Setup) -> dict[str, FloatArray]:
    """Return what is kept of a proposal: phase, corrected phase, outputs, tips of legs."""
    table = proposal.table
    phase = TURN * np.arange(table.length) / table.length
    outputs = {f"{channel.name}_{channel.unit}": channel.samples for channel in table.channels}
    tips: Mapping[str, FloatArray] = setup.tips(table)
    return {
        "phase_rad": phase,
        "psi_rad": proposal.phase_map(phase),
        **outputs,
        **{f"{name}_m": tip for name, tip in tips.items()},
    }


def summary(label: str, response: Response) -> str:
    """Return in a line what was found."""
    error = response.periodic_error
    return (
        f"{label}: periodic error {format_si(error.rms, response.unit, 3)} rms, "
        f"{format_si(error.pv, response.unit, 3)} peak-to-valley; noise floor "
        f"{format_si(response.noise_floor_rms, response.unit, 3)} rms"
    )
