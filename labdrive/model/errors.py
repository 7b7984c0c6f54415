"""Every error labdrive raises on purpose, in one family.

LabdriveError              exit 1
├── InputError             exit 2    a recipe, bench or command is wrong; nothing has moved
├── LimitError             exit 1    a table or motion would break a limit of the bench; refused
├── InterlockError         exit 3    a limit was passed while moving; the bench is safe
├── DeviceError            exit 1    a device did not answer, or answered nonsense
├── BusyError              exit 1    somebody else uses the bench or the run folder
├── PluginError            exit 1    a plugin broke its contract
├── StoreError             exit 1    a run folder or recording cannot be written or read
├── EstimationError        exit 1    a recording does not hold what an estimate needs
│   └── NonMonotonicError  exit 1    the response runs backwards, so it cannot be inverted
├── ReplayError            exit 1    a replayed run does not give what it gave
└── RunInterruptedError    exit 130  somebody stopped the run
"""

from dataclasses import dataclass
from typing import ClassVar


class LabdriveError(Exception):
    """Base of the family; `exit_code` is what the command line returns."""

    exit_code: ClassVar[int] = 1


@dataclass(frozen=True)
class Problem:
    """One thing wrong in a file: where it is, what it is, and the value that was found."""

    message: str
    field: str = ""
    file: str = ""
    line: int = 0
    column: int = 0
    got: str | None = None

    def __str__(self) -> str:
        """Return `FILE:LINE:COLUMN: field.path: message (got VALUE)`, without what is not known."""
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part)
        found = "" if self.got is None else f" (got {self.got})"
        return ": ".join(part for part in (place, self.field, self.message + found) if part)


class InputError(LabdriveError):
    """Something the user wrote is wrong; carries every problem found, one a line."""

    exit_code = 2

    def __init__(self, *problems: Problem | str) -> None:
        self.problems = tuple(p if isinstance(p, Problem) else Problem(p) for p in problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class LimitError(LabdriveError):
    """A table or motion would break a limit of the bench; it was refused and nothing moved."""


class InterlockError(LabdriveError):
    """A limit was passed while moving; motion was stopped and the bench made safe."""

    exit_code = 3


class DeviceError(LabdriveError):
    """A device did not answer, or answered nonsense."""


class BusyError(LabdriveError):
    """Somebody else uses the bench or the run folder; nothing was touched."""


class PluginError(LabdriveError):
    """A plugin broke its contract; names the plugin and its distribution."""


class StoreError(LabdriveError):
    """A run folder or a recording cannot be written or read; names the file."""


class EstimationError(LabdriveError):
    """A recording does not hold what an estimate needs; says what is missing."""


class NonMonotonicError(EstimationError):
    """The response runs backwards over some phases, so no phase map linearizes it.

    `phases` are the intervals (start, end) in rad over which it does.
    """

    def __init__(self, message: str, phases: tuple[tuple[float, float], ...]) -> None:
        self.phases = phases
        super().__init__(message)


class ReplayError(LabdriveError):
    """A replayed run does not give what it gave; names the step that differs."""


class RunInterruptedError(LabdriveError):
    """Somebody stopped the run (Ctrl-C, SIGTERM); the bench is safe and the folder says so."""

    exit_code = 130
