"""A file for libraries that cannot bear a failed write: it is kept, and raised when they are done.

HDF5 leaves objects that can be neither closed nor freed, and may end the process, when the disk
is full.
"""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class PatientFile(io.FileIO):
    """A file, open for writing and reading, whose writes seem to succeed after the first fails."""

    failure: OSError | None = None

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write all of `data`, or take note of why it cannot be; return its length."""
        view = memoryview(data).cast("B")
        self._attempt(lambda: self._write_all(view))
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length of the file, or take note of why it cannot be; return it."""
        self._attempt(lambda: super(PatientFile, self).truncate(size))
        return self.tell() if size is None else size

    def _write_all(self, view: memoryview) -> None:
        while view:
            view = view[super().write(view) :]

    def _attempt(self, action: Callable[[], object]) -> None:
        try:
            if self.failure is None:
                action()
        except OSError as error:
            self.failure = error


@contextmanager
def patient(path: Path) -> Iterator[PatientFile]:
    """Yield a new file; raise the OSError of the first write that failed when the block ends."""
    with PatientFile(path, "w+b") as file:
        try:
            yield file
        finally:
            if file.failure is not None:
                raise file.failure
