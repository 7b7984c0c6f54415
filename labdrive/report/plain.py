"""The report of a run that has no result, or a kind that has no report of its own."""

from labdrive.report.run_data import RunData
from labdrive.report.sections import Fact, Section


def facts(_run: RunData) -> list[Fact]:
    """Return nothing: what matters is not known."""
    return []


def summary(run: RunData) -> str:
    """Return how many recordings are there."""
    count = len(run.recordings)
    return f"{count} recording{'s' if count != 1 else ''} in the folder, each of them whole."


def sections(run: RunData) -> list[Section]:
    """Return the plain numbers and texts of the result."""
    rows = [(k, str(v)) for k, v in run.result.items() if isinstance(v, str | int | float)]
    return [Section("Result", head=("", ""), rows=rows)] if rows else []
