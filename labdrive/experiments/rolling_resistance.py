"""`rolling_resistance`: the force that stage and guide take without any load, both ways."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import Field

from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError, Problem
from labdrive.model.motion import Direction
from labdrive.model.units import format_si
from labdrive.periodic.cycle_mean import cycle_mean
from labdrive.periodic.measured import Measured

KIND = "rolling_resistance"


class RollingResistance:
    """Walks forward and back without load and compares the mean forces.

    Half their difference is the resistance; half their sum is what does not turn with the
    direction: an offset of the sensor, or a stage out of level.
    """

    class Settings(SettingsBase):
        """Settings of the measurement."""

        waveform: Waveform | None = Field(
            default=None, description="For actuators with a choice of waveform."
        )
        motion: MotionSettings
        force_sensor: SensorName

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the two recordings there will be."""
        settings = self._settings
        refuse_other_unit(setup, settings.force_sensor, "force_sensor")
        table, motion = setup.nominal_table(settings.waveform), settings.motion.motion()
        return [
            PlannedRecording(
                str(direction),
                replace(motion, direction=direction),
                table,
                return_to_start=settings.motion.return_to_start,
            )
            for direction in (Direction.FORWARD, Direction.BACKWARD)
        ]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Record both ways; return `rolling_resistance`, `offset` and what they come from [N]."""
        ways: dict[str, Measured] = {}
        for planned in self.plan(bench.setup):
            recording = bench.record(
                planned.motion,
                planned.table,
                planned.label,
                return_to_start=planned.return_to_start,
            )
            ways[planned.label] = cycle_mean(recording, self._settings.force_sensor)
        forward, backward = ways["forward"], ways["backward"]
        error = 0.5 * (forward.standard_error**2 + backward.standard_error**2) ** 0.5
        resistance = (forward.value - backward.value) / 2
        bench.note(f"rolling resistance {format_si(resistance, 'N', 3)}")
        return {
            "kind": KIND,
            "unit": "N",
            "sensor": self._settings.force_sensor,
            "rolling_resistance": resistance,
            "offset": (forward.value + backward.value) / 2,
            "standard_error": error,
            "forward": {"force": forward.value, "standard_error": forward.standard_error},
            "backward": {"force": backward.value, "standard_error": backward.standard_error},
        }


@dataclass(frozen=True)
class Unloaded:
    """Force [N] that a sensor reads in each direction without any load."""

    forward: float = 0.0
    backward: float = 0.0

    def load(self, force: float, direction: Direction) -> float:
        """Return the load [N] in a force read while walking that way."""
        without = self.forward if direction is Direction.FORWARD else self.backward
        return direction.sign * (force - without)


def read_unloaded(path: Path) -> Unloaded:
    """Return what result.json of a `rolling_resistance` run says; InputError if it is none."""
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        ways = {KIND: result}[result["kind"]]
        return Unloaded(float(ways["forward"]["force"]), float(ways["backward"]["force"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        message = f"{path} is not the result.json of a {KIND} run"
        raise InputError(Problem(message, "rolling_resistance_from")) from error


def refuse_other_unit(setup: Setup, sensor: str, field: str) -> None:
    """Raise InputError if a sensor that should read forces reads something else."""
    unit = setup.sensor_unit(sensor)
    if unit != "N":
        raise InputError(
            Problem(f"a force sensor is due; this one reads {unit}", field, got=sensor)
        )
