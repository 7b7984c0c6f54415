"""Write files so that a power cut leaves the old one, the new one, or none: never half of one."""

import errno
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from labdrive.model.errors import StoreError

_CURES = {
    errno.ENOSPC: "free some space on the disk, or write to another folder",
    errno.EDQUOT: "free some of your quota, or write to another folder",
    errno.EFBIG: "raise the limit on the size of files, or record less at a time",
    errno.EROFS: "the disk is mounted read-only; write to another folder",
    errno.EACCES: "get leave to write there, or write to another folder",
    errno.EPERM: "get leave to write there, or write to another folder",
    errno.EEXIST: "nothing is written over; take another name",
    errno.ENOTDIR: "part of the path is a file; write to another folder",
    errno.ENOENT: "its folder is gone; make it again, or write to another",
    errno.EIO: "the disk fails; write to another one",
}


@contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """Yield a path to write; it becomes `path` if the block succeeds, and is gone if it fails.

    The file is fsynced before it is renamed, and the folder after. StoreError if it cannot be
    written; `path` is then as it was before.
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
        with suppress(OSError):
            aside.unlink()


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with written_aside(path) as aside:
        aside.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` in UTF-8, whole or not at all."""
    write_bytes(path, text.encode())


def write_json(path: Path, value: Any) -> None:
    """Write `value` as JSON, whole or not at all; NaN is refused, for it is not JSON."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def make_folder(path: Path) -> None:
    """Make a new folder and those above it, durably; StoreError if it exists or cannot be made."""
    try:
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True)
        for folder in made:
            sync(folder.parent)
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
    """Return the error to raise when `path` could not be written, with the cure if it is known."""
    cure = _CURES.get(error.errno or 0)
    return StoreError(f"cannot write {path}: {error.strerror}" + (f"; {cure}" if cure else ""))
