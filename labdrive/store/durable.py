"""Write files so that a power cut leaves the old one, the new one, or none: never half of one."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from labdrive.model.errors import StoreError


@contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """Yield a path to write; it becomes `path` if the block succeeds, and is gone if it fails.

    The file is fsynced before it is renamed, and the folder after. StoreError if it cannot be
    written; nothing stands under `path` then that was not there before.
    """
    aside = path.with_name(f".{path.name}.part")
    try:
        yield aside
        sync(aside)
        aside.replace(path)
        sync(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        aside.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with written_aside(path) as aside:
        aside.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` in UTF-8, whole or not at all."""
    write_bytes(path, text.encode())


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401 whatever JSON holds
    """Write `value` as JSON, whole or not at all; NaN is refused, for it is not JSON."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def make_folder(path: Path) -> None:
    """Make a new folder, durably; StoreError if it exists or cannot be made."""
    try:
        path.mkdir(parents=True)
        sync(path)
        sync(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error


def sync(path: Path) -> None:
    """Bring a file or folder to the disk itself; Windows offers that for files only."""
    if os.name == "nt" and path.is_dir():
        return
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def cannot_write(path: Path, error: OSError) -> StoreError:
    """Return the error to raise when `path` could not be written."""
    cure = "; free some space, or choose another folder with --runs"
    return StoreError(f"cannot write {path}: {error.strerror or error}{cure}")
