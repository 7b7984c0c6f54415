"""Small turns of phrase that messages share."""

import difflib
from collections.abc import Iterable


def listed(names: Iterable[object], last: str = "or") -> str:
    """Return `a, b or c`; `none` if there are none."""
    *first, end = [str(name) for name in names] or ["none"]
    return f"{', '.join(first)} {last} {end}" if first else end


def guess(name: str, known: Iterable[str]) -> str:
    """Return `; did you mean X?`, or nothing if no name comes close."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {close[0]}?" if close else ""


def offer(known: Iterable[str]) -> str:
    """Return `there are a, b and c`."""
    names = sorted(known)
    return f"there {'are' if len(names) > 1 else 'is'} {listed(names, 'and')}"


def no_such(what: str, name: str, known: Iterable[str]) -> str:
    """Return `no such WHAT; did you mean X? there are X, Y and Z`."""
    names = sorted(known)
    return f"no such {what}{guess(name, names) or ';'} {offer(names)}"
