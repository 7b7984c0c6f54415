"""`reverse_check`: what a table made for one direction does in the other (paper, Figure 5)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from labdrive.experiments.entry import entry
from labdrive.experiments.iterate import (
    Loop,
    LoopSettings,
    Optimized,
    columns,
    finer,
    refuse_recordings,
)
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.optimizer import Proposal
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Direction
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN, WaveformTable
from labdrive.periodic.phase_map import node_phases
from labdrive.periodic.reversal import switch_jump, switch_phase

REVERSE = "reverse"


class ReverseCheck:
    """Optimizes in each direction, then plays every map both ways, and the mirrored table.

    All cases are recorded from the same start and sampled as a verification is.
    """

    class Settings(LoopSettings):
        """Settings of the check."""

        waveform: Waveform | None = Field(
            default=None, description="For actuators with a choice of waveform."
        )
        cross: bool = Field(
            default=True, description="Optimize backward as well, for the table of maps."
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings
        self._loops = {
            direction: Loop(
                settings.motion.model_copy(update={"direction": direction}),
                settings.sensor,
                settings.optimizer,
                settings.stop,
            )
            for direction in Direction
        }

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most this can come to: one loop or two, and every case."""
        settings = self._settings
        refuse_recordings(setup)
        if not settings.motion.return_to_start:
            message = "must be true: both directions are recorded from the same start"
            raise InputError(Problem(message, "motion.return_to_start", got="false"))
        if settings.motion.direction is not Direction.FORWARD:
            message = "both directions are walked; leave it out"
            raise InputError(Problem(message, "motion.direction", got="backward"))
        table = setup.nominal_table(settings.waveform)
        setup.optimizer(settings.optimizer, table)
        loops = [Direction.FORWARD, *([Direction.BACKWARD] if settings.cross else [])]
        planned = [self._loops[d].planned(table, f"{d} iteration") for d in loops]
        times = {Direction.FORWARD: 2 + settings.cross, Direction.BACKWARD: 3 + settings.cross}
        for direction, loop in self._loops.items():
            motion = finer(loop.motion.motion(), setup, settings.verification_factor)
            label = f"cases {direction}"
            planned.append(
                PlannedRecording(label, motion, table, times[direction], return_to_start=True)
            )
        return planned

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Optimize, record every case; return the contract's `reverse_check` result."""
        settings, setup = self._settings, bench.setup
        nominal = setup.nominal_table(settings.waveform)
        done = self._loops[Direction.FORWARD].run(bench, nominal, "forward")
        first, best = done.optimizer.first(), done.best.proposal
        cases = {
            f"{name}_{direction}": self._case(bench, done, proposal, direction, name)
            for name, proposal in (("unoptimized", first), ("optimized", best))
            for direction in Direction
        }
        result: dict[str, Any] = {
            "kind": "reverse_check",
            "unit": done.best.response.unit,
            "sensor": settings.sensor,
            "forward": done.result(),
        }
        reverse = setup.mirrored(best.table)
        if reverse is not None:
            result["switch_jump"] = _keep_reverse(bench, best, reverse)
            result["reverse_table"] = REVERSE
            proposal = replace(best, table=reverse)
            cases["swapped_backward"] = self._case(
                bench, done, proposal, Direction.BACKWARD, "swapped"
            )
        if settings.cross:
            result |= self._crossed(bench, nominal, cases)
        for name, case in cases.items():
            unit = result["unit"]
            bench.note(f"{name}: {format_si(case['periodic_error']['rms'], unit, 3)} rms")
        return result | {"cases": [{"name": name, **case} for name, case in cases.items()]}

    def _crossed(
        self, bench: Bench, nominal: WaveformTable, cases: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, Any]:
        """Optimize backward; return each map's error in each direction."""
        back = self._loops[Direction.BACKWARD].run(bench, nominal, "backward")
        best = back.best.proposal
        crossed = [
            *({"map": "forward", **cases[f"optimized_{direction}"]} for direction in Direction),
            *(
                {"map": "backward", **self._case(bench, back, best, direction, "backward map")}
                for direction in Direction
            ),
        ]
        return {"backward": back.result(), "cross": crossed}

    def _case(
        self, bench: Bench, done: Optimized, proposal: Proposal, direction: Direction, name: str
    ) -> dict[str, Any]:
        loop = self._loops[direction]
        motion = finer(loop.motion.motion(), bench.setup, self._settings.verification_factor)
        tried = loop.try_once(bench, done, proposal, f"{name} {direction}", motion)
        return {"direction": str(direction), **entry(tried.response, tried.recording)}


def _keep_reverse(bench: Bench, best: Proposal, reverse: WaveformTable) -> float:
    """Keep both tables, and where to go on in the other; return the jump of tips there [m]."""
    setup, phase = bench.setup, node_phases(reverse.length)
    go_on = np.mod(switch_phase(best.phase_map, phase), TURN)
    bench.keep_table("forward", {**columns(best, setup), "switch_phase_rad": go_on})
    bench.keep_table(REVERSE, columns(replace(best, table=reverse), setup))
    return switch_jump(setup.tips(best.table), setup.tips(reverse), best.phase_map)
