"""The journal of a run: one JSON object a line, on disk before the next thing happens."""

import json
import logging
import os
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from labdrive.model.errors import StoreError
from labdrive.store.durable import cannot_write, sync

log = logging.getLogger(__name__)

Entry = dict[str, Any]


class Journal:
    """An append-only file; what a crash tore off its end is dropped when it is opened again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.touch()
            whole = _whole_lines(path)
            self._size, self._count = len(whole), len(list(_entries(path, whole)))
            self._file = path.open("r+b", buffering=0)
            self._back_to_whole_lines()
            sync(path)
            sync(path.parent)
        except OSError as error:
            raise cannot_write(path, error) from error

    def append(self, event: str, **fields: object) -> None:
        """Write one entry; it is on the disk when this returns.

        StoreError if it cannot be written; the journal is then as it was before.
        """
        now = datetime.now(UTC).isoformat()
        entry = {"seq": self._count + 1, "time": now, "event": event, **fields}
        line = memoryview(json.dumps(entry, allow_nan=False).encode() + b"\n")
        try:
            written = 0
            while written < len(line):
                written += self._file.write(line[written:])
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._back_to_whole_lines()
            raise cannot_write(self.path, error) from error
        self._size += len(line)
        self._count += 1

    def _back_to_whole_lines(self) -> None:
        self._file.truncate(self._size)
        self._file.seek(self._size)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def read_journal(path: Path) -> list[Entry]:
    """Return the entries; a torn last line, whose append never returned, is logged and dropped.

    StoreError, naming the line, if any other is damaged, or if the file cannot be read.
    """
    try:
        whole = _whole_lines(path)
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror}") from error
    return list(_entries(path, whole))


def _entries(path: Path, data: bytes) -> Iterator[Entry]:
    for number, line in enumerate(data.split(b"\n")[:-1], start=1):
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise StoreError(f"{path}:{number}: damaged: not a JSON object") from error
        if not isinstance(entry, dict) or entry.get("seq") != number:
            raise StoreError(f"{path}:{number}: damaged: entry {number} is due here")
        yield entry


def _whole_lines(path: Path) -> bytes:
    """Return the file up to the end of its last whole line.

    A power cut can leave a line without its end, or with zeros where it never reached the disk.
    """
    data = path.read_bytes()
    end = data.rfind(b"\n") + 1
    last = data.rfind(b"\n", 0, max(end - 1, 0)) + 1
    end = last if b"\0" in data[last:end] else end
    if end < len(data):
        log.warning("%s: dropped a torn last line of %d bytes", path, len(data) - end)
    return data[:end]
