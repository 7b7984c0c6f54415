"""Which services live: each holds a lock of its own, which the kernel frees when it ends."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from labdrive.model.errors import BusyError
from labdrive.store.lock import held


@dataclass(frozen=True)
class Worker:
    """A service, by name, and the folder of all services' locks."""

    name: str
    folder: Path


@contextmanager
def working(folder: Path) -> Iterator[Worker]:
    """Be a worker for the length of the block."""
    worker = Worker(f"{os.getpid()}-{secrets.token_hex(4)}", folder)
    path = folder / f"{worker.name}.lock"
    with held(path, f"the worker {worker.name}"):
        yield worker
    for left in folder.glob(f"{worker.name}.*"):
        left.unlink(missing_ok=True)


def is_alive(folder: Path, name: str) -> bool:
    """Return whether the worker of that name still holds its lock."""
    path = folder / f"{name}.lock"
    if not name or not path.exists():
        return False
    try:
        with held(path, f"the worker {name}"):
            return False
    except BusyError:
        return True
