"""Turn Ctrl-C and SIGTERM into one orderly end of a run."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from labdrive.model.errors import RunInterruptedError

Handler = Callable[[int, FrameType | None], None] | signal.Handlers


@contextmanager
def interruptible() -> Iterator[Callable[[], None]]:
    """Raise RunInterruptedError in the block at the first SIGINT or SIGTERM; ignore later ones.

    An impatient second Ctrl-C must not cut `make_safe` short. Yields a function that raises it once
    more, for a run to call now and then: a plugin or library may have swallowed the first. Does
    nothing outside the main thread, where Python delivers no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    asked = ""

    def stop(number: int, _frame: FrameType | None) -> None:
        nonlocal asked
        if not asked:
            asked = f"stopped by {signal.Signals(number).name}"
            raise RunInterruptedError(asked)

    def refuse_asked() -> None:
        if asked:
            raise RunInterruptedError(asked)

    with _handled_by(stop):
        yield refuse_asked


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ignore SIGINT and SIGTERM in the block: it is short, and half of it would be a lie."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _handled_by(signal.SIG_IGN):
        yield


@contextmanager
def _handled_by(handler: Handler) -> Iterator[None]:
    before = {s: signal.signal(s, handler) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)
