"""`characterize_spindle`: both directions, backlash apart from the periodic error, a map for each.

Target positions are approached from both sides, several times, as ISO 230-2 asks; the periodic
error of each direction is estimated and corrected by itself, so that no backlash is in a map.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from labdrive.experiments.entry import entry
from labdrive.experiments.iterate import columns, refuse_recordings
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.optimizer import Optimizer, Proposal
from labdrive.interfaces.settings import PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError, InputError, Problem
from labdrive.model.motion import Direction, Motion
from labdrive.model.recording import Recording
from labdrive.model.units import format_si
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.bidirectional import Positioning, Targets, positioning, targets
from labdrive.periodic.response import Response

RUNS = 5
TARGETS = "targets"
REVOLUTION = "revolution"


class CharacterizeSpindle:
    """Runs forward and backward over the same targets; corrects each direction and looks again."""

    class Settings(SettingsBase):
        """Settings of the characterization."""

        motion: MotionSettings
        sensor: SensorName = Field(description="The bench's sensor of the carriage's position.")
        runs: int = Field(
            default=RUNS, ge=2, le=100, description="Approaches of each target from each side."
        )
        optimizer: Annotated[SettingsBase, PluginSlot("optimizers", key="use")]
        nested: dict[str, int] = Field(
            default_factory=dict,
            description="Cycles within a revolution by name, as `electrical_turn: 5` for a motor "
            "of five pole pairs; their harmonics are told apart.",
        )
        correct: bool = Field(
            default=True, description="Make a map for each direction and record with it."
        )

        @field_validator("nested")
        @classmethod
        def _several(cls, nested: dict[str, int]) -> dict[str, int]:
            for name, cycles in nested.items():
                if cycles < 2:
                    raise ValueError(f"{name} must be 2 cycles a revolution or more")
            return nested

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return all recordings: forward and backward in turn."""
        settings = self._settings
        refuse_recordings(setup)
        _check_motion(settings.motion)
        table = setup.nominal_table(None)
        setup.optimizer(settings.optimizer, table)
        times = settings.runs + settings.correct
        return [
            PlannedRecording(str(direction), self._motion(direction), table, times)
            for direction in Direction
        ]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Record, evaluate, correct; return the result."""
        settings, setup = self._settings, bench.setup
        table = setup.nominal_table(None)
        recorded = self._recorded(bench, table)
        optimizer = {d: setup.optimizer(settings.optimizer, table) for d in Direction}
        responses = {
            d: mean_response([optimizer[d].estimate(r, settings.sensor) for r in recorded[d]])
            for d in Direction
        }
        forward, backward = responses.values()
        lead = math.copysign(setup.travel_per_period(table), forward.step_size)
        found = self._targets(recorded, lead)
        iso = positioning(found)
        bench.keep_table(TARGETS, _columns(found, lead, settings.motion.samples_per_period))
        for text in _told(iso, responses):
            bench.note(text)
        result: dict[str, Any] = {
            "kind": "characterize_spindle",
            "unit": forward.unit,
            "sensor": settings.sensor,
            "runs": settings.runs,
            "targets": len(found.forward),
            "lead": {
                "nominal": abs(lead),
                "forward": forward.step_size,
                "backward": backward.step_size,
            },
            "backlash": {
                "value": -iso.mean_reversal_value * math.copysign(1, lead),
                "standard_error": _reversal_error(found, settings.runs),
            },
            "iso_230_2": iso.as_dict(),
            "directions": {
                str(d): {"before": entry(responses[d], recorded[d][0])} for d in Direction
            },
        }
        if settings.correct:
            self._correct(bench, optimizer, responses, result)
        return result | {"cycles": _cycles(settings.nested, result["directions"])}

    def _motion(self, direction: Direction) -> Motion:
        motion: Motion = self._settings.motion.motion()
        return replace(motion, direction=direction)

    def _recorded(self, bench: Bench, table: WaveformTable) -> dict[Direction, list[Recording]]:
        """Record every run; each backward one leads back to where its forward one began."""
        recorded: dict[Direction, list[Recording]] = {d: [] for d in Direction}
        for run in range(self._settings.runs):
            for direction, made in recorded.items():
                label = f"{direction} run {run + 1}"
                made.append(bench.record(self._motion(direction), table, label))
        return recorded

    def _targets(self, recorded: Mapping[Direction, Sequence[Recording]], lead: float) -> Targets:
        """Return deviations at the targets that both directions pass.

        A backward motion settles over the cycles that a forward one has recorded last.
        """
        motion, sensor = self._motion(Direction.FORWARD), self._settings.sensor
        m = motion.samples_per_period
        last = (motion.periods - motion.settle_periods) * m
        due = lead * np.arange(last + 1) / m

        def deviations(direction: Direction, picked: slice) -> FloatArray:
            readings = [_complete(r, sensor, motion)[picked] for r in recorded[direction]]
            return np.asarray(np.stack(readings)) - due

        forward = deviations(Direction.FORWARD, slice(0, last + 1))
        backward = deviations(Direction.BACKWARD, slice(last, None, -1))
        origin = 0.5 * (forward.mean() + backward.mean())
        return targets(forward - origin, backward - origin)

    def _correct(
        self,
        bench: Bench,
        optimizers: Mapping[Direction, Optimizer],
        responses: Mapping[Direction, Response],
        result: dict[str, Any],
    ) -> None:
        """Give each direction the map that undoes its own error, and record with it."""
        for direction, optimizer in optimizers.items():
            proposal: Proposal = optimizer.next(optimizer.first(), responses[direction])
            bench.keep_table(f"map-{direction}", columns(proposal, bench.setup))
            label = f"{direction}, corrected"
            recording = bench.record(self._motion(direction), proposal.table, label)
            response = optimizer.estimate(recording, self._settings.sensor)
            told = result["directions"][str(direction)]
            told |= {"corrected": entry(response, recording), "map": f"map-{direction}"}
            rms = [told[when]["periodic_error"]["rms"] for when in ("before", "corrected")]
            told["improvement"] = rms[0] / rms[1]
            shown = [format_si(value, response.unit, 3) for value in rms]
            bench.note(f"{direction}: periodic error {shown[0]} to {shown[1]} rms")


def mean_response(responses: Sequence[Response]) -> Response:
    """Return the mean of responses to the same motion, with the errors of a mean."""
    count = len(responses)
    errors = np.stack([response.standard_errors for response in responses])
    steps = np.array([response.step_size_standard_error for response in responses])
    return replace(
        responses[0],
        step_size=float(np.mean([response.step_size for response in responses])),
        harmonics=np.mean([response.harmonics for response in responses], axis=0),
        standard_errors=np.sqrt(np.mean(errors**2, axis=0) / count),
        step_size_standard_error=float(np.sqrt(np.mean(steps**2) / count)),
        noise_bins=count * responses[0].noise_bins,
    )


def _check_motion(motion: MotionSettings) -> None:
    """Raise InputError if the two directions would not share their targets."""
    if motion.direction is not Direction.FORWARD:
        message = "both directions are walked; leave it out"
        raise InputError(Problem(message, "motion.direction", got="backward"))
    if motion.settle_periods < 1:
        message = "must be 1 or more: the backlash is taken up while it settles"
        raise InputError(Problem(message, "motion.settle_periods", got="0"))
    if motion.periods < motion.settle_periods + 2:
        message = (
            f"must be {motion.settle_periods + 2} or more, two beyond settle_periods: each "
            "direction settles where the other is recorded"
        )
        raise InputError(Problem(message, "motion.periods", got=str(motion.periods)))


def _complete(recording: Recording, sensor: str, motion: Motion) -> FloatArray:
    """Return a recording's readings; EstimationError unless there is one at each target."""
    readings = recording.readings[sensor]
    if len(readings) != motion.samples:
        raise EstimationError(
            f"{recording.label}: {len(readings)} readings for {motion.samples} targets; "
            "characterize_spindle needs a sensor that is triggered, or a drive that stops to be "
            "read"
        )
    return readings


def _reversal_error(found: Targets, runs: int) -> float:
    """Return the standard error of the mean reversal value."""
    variance = (found.spread_forward**2 + found.spread_backward**2) / runs
    return float(np.sqrt(variance.mean() / len(variance)))


def _columns(found: Targets, lead: float, samples_per_period: int) -> dict[str, FloatArray]:
    """Return what is kept of the targets."""
    return {
        "target_m": lead * np.arange(len(found.forward)) / samples_per_period,
        "forward_m": found.forward,
        "backward_m": found.backward,
        "spread_forward_m": found.spread_forward,
        "spread_backward_m": found.spread_backward,
        "reversal_m": found.reversal,
    }


def _told(iso: Positioning, responses: Mapping[Direction, Response]) -> list[str]:
    """Return in lines what was found."""
    unit = responses[Direction.FORWARD].unit
    reversal, accuracy = (format_si(v, unit, 4) for v in (iso.mean_reversal_value, iso.accuracy))
    lines = [f"mean reversal value {reversal}; bidirectional accuracy {accuracy}"]
    for direction, response in responses.items():
        rms = format_si(response.periodic_error.rms, unit, 3)
        lines.append(f"{direction}: periodic error {rms} rms")
    return lines


def _cycles(nested: Mapping[str, int], directions: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return how much of the periodic error repeats in each cycle, rms.

    A harmonic belongs to the shortest cycle that it is a whole multiple of; so the revolution has
    what is left.
    """
    cycles = {REVOLUTION: 1, **nested}
    ordered = sorted(cycles.items(), key=lambda cycle: -cycle[1])

    def owner(k: int) -> str:
        return next(name for name, count in ordered if k % count == 0)

    def rms(found: Mapping[str, Any], name: str) -> float:
        squares = [h["amplitude"] ** 2 / 2 for h in found["harmonics"] if owner(h["k"]) == name]
        return math.sqrt(math.fsum(squares))

    return [
        {"name": name, "per_revolution": count}
        | {
            f"{direction}_{when}": {"rms": rms(found[when], name)}
            for direction, found in directions.items()
            for when in ("before", "corrected")
            if when in found
        }
        for name, count in cycles.items()
    ]
