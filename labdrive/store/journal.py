"""The journal of a run: one JSON object a line, on disk before the next thing happens."""

import json
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from labdrive.model.errors import StoreError
from labdrive.store.durable import cannot_write, sync

Entry = dict[str, Any]


class Journal:
    """An append-only file; what a crash tore off its end is dropped when it is opened again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("ab+")
            whole = _whole_bytes(path.read_bytes())
            self._file.truncate(whole)
            self._count = len(read_journal(path))
            sync(path)
            sync(path.parent)
        except OSError as error:
            raise cannot_write(path, error) from error

    def append(self, event: str, **fields: object) -> None:
        """Write one entry; it is on the disk when this returns, or StoreError is raised."""
        now = datetime.now(UTC).isoformat()
        entry = {"seq": self._count + 1, "time": now, "event": event, **fields}
        try:
            self._file.write(json.dumps(entry, allow_nan=False).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise cannot_write(self.path, error) from error
        self._count += 1

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
    """Return the entries, without a torn last line; StoreError if any other line is damaged."""
    data = path.read_bytes()
    return list(_entries(path, data[: _whole_bytes(data)]))


def _entries(path: Path, data: bytes) -> Iterator[Entry]:
    for number, line in enumerate(data.splitlines(), start=1):
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise StoreError(f"{path}:{number}: damaged: not a JSON object") from error
        if not isinstance(entry, dict) or entry.get("seq") != number:
            raise StoreError(f"{path}:{number}: damaged: entry {number} is due here")
        yield entry


def _whole_bytes(data: bytes) -> int:
    """Return the length of `data` up to the end of its last whole line."""
    return data.rfind(b"\n") + 1
