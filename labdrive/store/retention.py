"""Which runs may go: never the last good one of a recipe on a bench, never one at work."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labdrive.model.errors import BusyError
from labdrive.store.lock import held
from labdrive.store.run_folder import LOCK, list_runs


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
        elif info.get("status") in ("running", "interrupted", "unreadable"):
            why = f"{info['status']}: it may be gone on with"
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
    """Remove a run's folder; return False if a process is at work in it after all."""
    try:
        with held(run.path / LOCK, str(run.path)):
            pass
    except BusyError:
        return False
    shutil.rmtree(run.path)
    return True


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
