"""Locks that the kernel frees when their holder ends, however it ends."""

import hashlib
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from labdrive.model.errors import BusyError
from labdrive.store.durable import cannot_write

IN_USE = " is in use by "
CURE = "; wait for it, or end it"


@contextmanager
def held(path: Path, what: str, note: str = "", patience_s: float = 0.0) -> Iterator[None]:
    """Hold the lock file `path`; BusyError if another process does for longer than `patience_s`.

    `what` is named in the error, with the holder's process id and `note`, which stand in a file
    beside the lock. StoreError if the file cannot be written.
    """
    from filelock import FileLock, Timeout

    with ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            stack.enter_context(FileLock(path, timeout=patience_s))
            _holder_file(path).write_text(f"process {os.getpid()} {note}".strip(), encoding="utf-8")
        except Timeout:
            file = _holder_file(path)
            by = file.read_text(encoding="utf-8") if file.is_file() else "another process"
            raise BusyError(f"{what}{IN_USE}{by}{CURE}") from None
        except OSError as error:
            raise cannot_write(path, error) from error
        yield


def tells_busy(line: str) -> bool:
    """Return whether a line that a command printed is the BusyError of a bench or a run.

    Drivers have errors of their own that speak of what is in use; these begin or end otherwise.
    """
    ours = line.startswith(("the bench ", "the run ")) and line.endswith(CURE)
    return ours and IN_USE in line


def _holder_file(path: Path) -> Path:
    return path.with_suffix(".holder")


def holder(path: Path) -> int | None:
    """Return the id of the process that holds or last held the lock file; None if not known."""
    try:
        return int(_holder_file(path).read_text(encoding="utf-8").split()[1])
    except (OSError, IndexError, ValueError):
        return None


def is_held(path: Path) -> bool | None:
    """Return whether a process holds the lock file `path`; None where that cannot be told."""
    if os.name == "nt":
        return None
    import fcntl

    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    except OSError:
        return None
    return False


def bench_lock(bench: Path) -> Path:
    """Return the lock of a bench: one for each bench file, in the user's state folder."""
    name = hashlib.sha256(str(bench.resolve()).encode()).hexdigest()[:16]
    return state_folder() / "benches" / f"{bench.stem}-{name}.lock"


def state_folder() -> Path:
    """Return LABDRIVE_STATE, or the place the system has for such files."""
    if given := os.environ.get("LABDRIVE_STATE"):
        return Path(given)
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "labdrive"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "labdrive"
