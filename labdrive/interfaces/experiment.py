"""What an experiment is: a plain function of recordings. It holds no hardware, no hidden state."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from pydantic import BaseModel

from labdrive.interfaces.optimizer import Optimizer
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import WaveformTable

Tables = WaveformTable | Mapping[str, WaveformTable]
"""What is to be played: the table of the recipe's actuator, or a table for each of several."""


@dataclass(frozen=True)
class PlannedRecording:
    """A recording an experiment may ask for, at most `times` times.

    `load` is the largest external force under it [N], None where no load is set for it.
    """

    label: str
    motion: Motion
    table: Tables
    times: int = 1
    return_to_start: bool = False
    load: float | None = None


class Setup(Protocol):
    """What is known of a bench before anything is connected."""

    @property
    def position_unit(self) -> str:
        """Unit of the actuator's travel: m or rad."""

    @property
    def max_samples_per_period(self) -> int | None:
        """The most samples a cycle the actuator can clock, None if nothing bounds it."""

    @property
    def sampling(self) -> Sampling:
        """How the samples of a recording will come about."""

    @property
    def fixed_motion(self) -> Motion | None:
        """The only motion there is, where nothing can be driven (a recording); else None."""

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the actuator's uncorrected table."""

    def travel_per_period(self, table: WaveformTable) -> float:
        """Return the travel expected of one cycle [position_unit]."""

    def tips(self, table: WaveformTable) -> Mapping[str, FloatArray]:
        """Return the tips of the legs, as `HasLegs.tips`; nothing for actuators without legs."""

    def mirrored(self, table: WaveformTable) -> WaveformTable | None:
        """Return the table for travel the other way, as `HasLegs.mirrored`; None without legs."""

    def of(self, actuator: str) -> "Setup":
        """Return the same for another actuator of the bench."""

    @property
    def has_load(self) -> bool:
        """True if the bench can put an external force on the actuator."""

    def sensor_unit(self, sensor: str) -> str:
        """Return the SI unit of a sensor of the bench."""

    def optimizer(self, settings: Any, nominal: WaveformTable) -> Optimizer:
        """Return the optimizer that a recipe's `optimizer` section names, for this table."""


class Bench(Protocol):
    """All an experiment can do to the world, each answer durable before it is given."""

    @property
    def setup(self) -> Setup:
        """What is known of the bench without asking it."""

    def record(
        self, motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
    ) -> Recording:
        """Play the table over the motion and return what every sensor of the bench read.

        With tables for several actuators, all walk the same motion in step.
        LimitError before anything moves if table or motion would break a limit. With
        `return_to_start` the motion is walked back afterwards, unrecorded.
        """

    @property
    def run(self) -> str:
        """Name of the run, as its folder has it."""

    def set_load(self, force: float) -> float:
        """Put `force` [N] against the travel; return what it came to [N].

        DeviceError if the bench's load cannot.
        """

    def note(self, text: str) -> None:
        """Say one line to whoever watches."""

    def keep_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Write `tables/NAME.csv`; columns of one length, their names with units (`psi_rad`)."""

    def keep_file(self, name: str, text: str) -> None:
        """Write a text file into the run's folder, for other benches or recipes to include."""


class Experiment(Protocol):
    """The `kind` of a recipe."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any) -> None:
        """Keep the settings."""

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the recordings the run may need, the most that it can come to. Pure."""

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Ask the bench for recordings; return the result as plain values for result.json."""
