"""Whether a run fits on the disk, asked before anything moves."""

import shutil
from pathlib import Path

from labdrive.engine.plan import Plan
from labdrive.model.errors import StoreError

# Journal, tables, report and log besides the recordings.
BESIDES_BYTES = 20_000_000


def refuse_full_disk(plan: Plan, runs: Path) -> None:
    """Raise StoreError if the plan would not fit on the disk that `runs` is, or will be, on.

    While a recording lasts its spool takes as much again.
    """
    there = next(folder for folder in (runs.resolve(), *runs.resolve().parents) if folder.exists())
    needed, free = 2 * plan.disk_bytes + BESIDES_BYTES, shutil.disk_usage(there).free
    if needed > free:
        raise StoreError(
            f"the run needs up to {_mb(needed)}, the disk of {there} has {_mb(free)} free; make "
            "room (labdrive runs prune), or name another folder with --runs"
        )


def _mb(count: int) -> str:
    return f"{count / 1e6:.0f} MB"
