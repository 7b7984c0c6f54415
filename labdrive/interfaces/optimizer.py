"""What an optimizer is: it reads a recording and proposes the next table."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from pydantic import BaseModel

from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.phase_map import PhaseMap
from labdrive.periodic.response import Response


@dataclass(frozen=True, eq=False)
class Proposal:
    """A table to try next, and the phase map that made it from the nominal one.

    `remark` is what whoever reads the report should know of it, in a few words.
    """

    table: WaveformTable
    phase_map: PhaseMap
    remark: str = ""


@runtime_checkable
class ChecksSampling(Protocol):
    """What an optimizer that cannot use every recording can say besides."""

    def check_sampling(self, sampling: Sampling) -> None:
        """Refuse, by InputError, recordings of this kind. Pure: plans are held to it."""


class Optimizer(Protocol):
    """Chooses tables from recordings. Must not know the plant: simulators are models too."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any, nominal: WaveformTable) -> None:
        """Keep the settings and the nominal table. InputError if they do not go together."""

    def first(self) -> Proposal:
        """Return the table to start with."""

    def estimate(self, recording: Recording, sensor: str) -> Response:
        """Return the response that `sensor` saw; EstimationError if the recording is too poor."""

    def next(self, tried: Proposal, response: Response) -> Proposal:
        """Return a table that should do better than the one that gave this response.

        NonMonotonicError if the response cannot be inverted.
        """
