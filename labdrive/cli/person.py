"""The person at the terminal, where there is one."""

import sys
from collections.abc import Callable

from labdrive.model.errors import RunInterruptedError


def person() -> Callable[[str], str] | None:
    """Return what puts a question to whoever is at the terminal; None if nobody can be."""
    return _ask if sys.stdin is not None and sys.stdin.isatty() else None


def _ask(question: str) -> str:
    """Ask on standard error, as standard output may be JSON; the end of input ends the run."""
    print(question, end="", file=sys.stderr, flush=True)
    answer = sys.stdin.readline()
    if not answer:
        raise RunInterruptedError("the terminal was closed while a question was open")
    return answer.strip()
