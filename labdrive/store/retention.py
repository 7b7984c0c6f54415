"""Which runs may go: never the last good one of a recipe on a bench, at work, or cut short."""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labdrive.model.errors import BusyError, StoreError
from labdrive.store.lock import held, is_held
from labdrive.store.run_folder import LOCK, list_runs, present_status

# Others could be resumed as well, but failed or were stopped by an interlock: that may go.
WHY = {
    "running": "it is at work",
    "cut short": "cut short: labdrive resume can go on with it",
    "interrupted": "interrupted: labdrive resume can go on with it",
    "unreadable": "its run.json cannot be read; look at it yourself",
}


@dataclass(frozen=True)
class Kept:
    """A run, its size in bytes, and why it cannot go; "" if it may."""

    path: Path
    info: dict[str, Any]
    size: int
    why: str = ""


def runs_by_age(root: Path) -> list[Kept]:
    """Return the runs under `root`, newest first, with what protects each."""
    good: set[tuple[str, str]] = set()
    found = []
    for info in list_runs(root):
        path, key = root / info["id"], (str(info.get("recipe")), str(info.get("bench")))
        why = ""
        if info.get("status") == "done" and key not in good:
            good.add(key)
            why = "the last good run of its recipe on its bench"
        else:
            why = WHY.get(present_status(path, str(info.get("status"))), "")
        found.append(Kept(path, info, _size(path), why))
    return found


def to_go(runs: list[Kept], budget: int | None, keep: int | None) -> Iterator[Kept]:
    """Yield runs that may go, oldest first, until what is left fits `budget` [bytes] and `keep`."""
    total, count = sum(run.size for run in runs), len(runs)
    for run in reversed(runs):
        too_much = budget is not None and total > budget
        too_many = keep is not None and count > keep
        if not (too_much or too_many):
            return
        if not run.why:
            total, count = total - run.size, count - 1
            yield run


def remove(run: Kept) -> bool:
    """Remove a run's folder; return False if a process is at work in it after all.

    StoreError if it cannot be removed.
    """
    try:
        with held(run.path / LOCK, str(run.path)):
            pass
    except BusyError:
        return False
    except StoreError:
        # A full disk has no room for the holder's name; to make some is what is asked for.
        if is_held(run.path / LOCK) is not False:
            raise
    try:
        shutil.rmtree(run.path)
    except OSError as error:
        raise StoreError(f"cannot remove {run.path}: {error.strerror or error}") from error
    return True


def _size(path: Path) -> int:
    """Return the bytes in a folder; what a run that is at work removes meanwhile does not count."""
    total = 0
    for file in path.rglob("*"):
        with suppress(OSError):
            total += file.stat().st_size if file.is_file() else 0
    return total
