"""What a run tells its listeners, at human rate: progress bars, logs, hooks, dashboards."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RunStarted:
    """A run has its folder and is about to connect its devices."""

    run: str
    title: str
    recordings: int
    """Recordings the plan foresees at most."""


@dataclass(frozen=True)
class RecordingStarted:
    """A motion begins; `samples` will be recorded over `duration_s` seconds."""

    number: int
    label: str
    samples: int
    duration_s: float


@dataclass(frozen=True)
class RecordingProgress:
    """So many samples of the current recording are in; at most a few events a second."""

    number: int
    samples: int


@dataclass(frozen=True)
class RecordingFinished:
    """The recording is whole and on disk; `file` is relative to the run folder."""

    number: int
    label: str
    file: str


@dataclass(frozen=True)
class ReturnStarted:
    """A motion is walked back, unrecorded; it takes `duration_s` seconds."""

    duration_s: float


@dataclass(frozen=True)
class Note:
    """Something an experiment wants said, in one line."""

    text: str


@dataclass(frozen=True)
class RunEnded:
    """The run is over, devices safe; `status` as in run.json, `reason` empty when done."""

    run: str
    status: str
    reason: str


Event = (
    RunStarted
    | RecordingStarted
    | RecordingProgress
    | RecordingFinished
    | ReturnStarted
    | Note
    | RunEnded
)
