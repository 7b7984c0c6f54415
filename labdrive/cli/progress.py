"""Show a run's events: a progress bar on a terminal, plain lines with the time otherwise."""

import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TextIO, cast

from labdrive.model.events import (
    Event,
    Note,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
    ReturnStarted,
    RunEnded,
    RunStarted,
)

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


@contextmanager
def listener() -> Iterator[Callable[[Event], None]]:
    """Yield what an engine calls with each event; everything goes to standard error.

    A terminal that is lost, or a full disk behind a redirection, ends no run.
    """
    try:
        with _shown(sys.stderr) as listen:
            yield listen
    finally:
        _drop_if_lost(sys.stderr)


@contextmanager
def _shown(stream: TextIO) -> Iterator[Callable[[Event], None]]:
    patient = cast(TextIO, _Patient(stream))
    if not stream.isatty():
        yield _Lines(patient)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(file=patient), transient=True) as progress:
        yield _Bars(progress)


def sentence(event: Event) -> str | None:
    """Return an event as one line; None for what only moves a bar."""
    text: str | None
    match event:
        case RunStarted():
            text = f"{event.run}: {event.title}".rstrip(": ")
        case RecordingStarted():
            text = f"recording {event.number}: {event.label}, {event.samples} samples"
        case RecordingFinished():
            text = f"recording {event.number}: on disk as {event.file}"
        case ReturnStarted():
            text = f"walking back, {event.duration_s:.3g} s"
        case Note():
            text = event.text
        case RunEnded():
            text = f"{event.run}: {event.status}"
        case RecordingProgress():
            text = None
    return text


class _Patient(io.TextIOBase):
    """A stream whose failures concern nobody."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """That of the stream: it decides which characters a bar is drawn with."""
        return self._stream.encoding

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return that of the stream."""
        return self._stream.fileno()

    def write(self, text: str) -> int:
        """Write what can be written."""
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush what can be flushed."""
        with suppress(OSError):
            self._stream.flush()


def _drop_if_lost(stream: TextIO) -> None:
    """Point a stream that cannot be written at nothing, or what it holds fails at the end."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Lines:
    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __call__(self, event: Event) -> None:
        text = sentence(event)
        if text is not None:
            now = datetime.now(UTC).strftime("%H:%M:%SZ")
            print(f"{now} {text}", file=self._stream, flush=True)


class _Bars:
    """One bar, for the motion under way; notes scroll above it."""

    def __init__(self, progress: "Progress") -> None:
        self._progress = progress
        self._task: TaskID | None = None

    def __call__(self, event: Event) -> None:
        match event:
            case RecordingStarted():
                self._show(event.label, event.samples)
            case ReturnStarted():
                self._show(sentence(event) or "", None)
            case RecordingProgress():
                if self._task is not None:
                    self._progress.update(self._task, completed=event.samples)
            case RecordingFinished():
                self._clear()
            case Note() | RunStarted() | RunEnded():
                self._clear()
                self._progress.console.print(sentence(event), markup=False, highlight=False)

    def _show(self, label: str, samples: int | None) -> None:
        self._clear()
        self._task = self._progress.add_task(label, total=samples)

    def _clear(self) -> None:
        if self._task is not None:
            self._progress.remove_task(self._task)
            self._task = None
