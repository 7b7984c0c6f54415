"""Turn Ctrl-C, SIGTERM and a lost terminal into one orderly end of a run."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from labdrive.model.errors import RunInterruptedError

Handler = Callable[[int, FrameType | None], None] | signal.Handlers


@contextmanager
def interruptible() -> Iterator[Callable[[], None]]:
    """Raise RunInterruptedError in the block at the first SIGINT, SIGTERM or SIGHUP.

    Later ones are ignored: an impatient second Ctrl-C must not cut `make_safe` short. Yields a
    function that raises it once more, for a run to call now and then: a plugin or library may have
    swallowed the first. Does nothing outside the main thread, where Python delivers no signals.
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
    """Ignore those signals in the block: it is short, and half of it would be a lie."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _handled_by(signal.SIG_IGN):
        yield


@contextmanager
def _handled_by(handler: Handler) -> Iterator[None]:
    before = {s: signal.signal(s, handler) for s in _signals()}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


def _signals() -> list[signal.Signals]:
    """Return the signals that end a run; SIGHUP where there is one, and nohup has not hidden it."""
    asked = [signal.SIGINT, signal.SIGTERM]
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        asked.append(signal.SIGHUP)
    return asked
