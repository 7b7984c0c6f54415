"""Show a run's events: a progress bar on a terminal, plain lines with the time otherwise."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from labdrive.model.events import (
    Event,
    Note,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
    RunEnded,
    RunStarted,
)

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


@contextmanager
def listener() -> Iterator[Callable[[Event], None]]:
    """Yield what an engine calls with each event; everything goes to standard error."""
    if not sys.stderr.isatty():
        yield _Lines()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} samples"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield _Bars(progress)


def sentence(event: Event) -> str | None:
    """Return an event as one line; None for what only moves a bar."""
    match event:
        case RunStarted():
            return f"{event.run}: {event.title}".rstrip(": ")
        case RecordingStarted():
            return f"recording {event.number}: {event.label}, {event.samples} samples"
        case RecordingFinished():
            return f"recording {event.number}: on disk as {event.file}"
        case Note():
            return event.text
        case RunEnded():
            return f"{event.run}: {event.status}"
        case RecordingProgress():
            return None


class _Lines:
    def __call__(self, event: Event) -> None:
        text = sentence(event)
        if text is not None:
            now = datetime.now(UTC).strftime("%H:%M:%SZ")
            print(f"{now} {text}", file=sys.stderr, flush=True)


class _Bars:
    """One bar, for the recording under way; notes scroll above it."""

    def __init__(self, progress: "Progress") -> None:
        self._progress = progress
        self._task: TaskID | None = None

    def __call__(self, event: Event) -> None:
        if isinstance(event, RecordingStarted):
            self._task = self._progress.add_task(event.label, total=event.samples)
        elif isinstance(event, RecordingProgress) and self._task is not None:
            self._progress.update(self._task, completed=event.samples)
        elif isinstance(event, RecordingFinished) and self._task is not None:
            self._progress.remove_task(self._task)
            self._task = None
        elif isinstance(event, Note | RunStarted | RunEnded):
            self._progress.console.print(sentence(event), markup=False, highlight=False)
