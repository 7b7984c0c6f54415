"""Plain data that remembers where each value and each key stood in the text it came from."""

from dataclasses import dataclass, field
from typing import Any

from labdrive.model.errors import Problem

FieldPath = tuple[str | int, ...]


@dataclass(frozen=True)
class Place:
    """Where something was written; `label` is a file, or the option that set it (line 0)."""

    label: str
    line: int = 0
    column: int = 0


@dataclass
class Source:
    """Plain data with the place of every value and key, and what was wrong with the text."""

    label: str
    data: Any = None
    values: dict[FieldPath, Place] = field(default_factory=dict)
    keys: dict[FieldPath, Place] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    whole: bool = False
    """Whether there was data to be had at all."""

    def place(self, path: FieldPath, *, key: bool = False) -> Place:
        """Return the place of a value (or its key); of the key above it where it is absent."""
        if path in self.values and not key:
            return self.values[path]
        while path and path not in self.keys:
            path = path[:-1]
        return self.keys.get(path) or self.values.get((), Place(self.label))

    def problem(
        self, path: FieldPath, message: str, got: str | None = None, *, key: bool = False
    ) -> Problem:
        """Return a problem that points at a field."""
        at = self.place(path, key=key)
        return Problem(message, dotted(path), at.label, at.line, at.column, got)

    def forget(self, path: FieldPath) -> None:
        """Drop the places of a value and of all that is in it."""
        for places in (self.values, self.keys):
            for inside in [known for known in places if known[: len(path)] == path]:
                del places[inside]


def dotted(path: FieldPath) -> str:
    """Return a path as messages write it: `sensors.ruler.pitch`, `steps.0.load`."""
    return ".".join(str(part) for part in path)
