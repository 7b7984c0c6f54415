"""The report of a run without a result, or of a kind that has no report of its own."""

from collections.abc import Mapping, Sequence
from typing import Any

from labdrive.report.run_data import RunData
from labdrive.report.sections import Fact, Section
from labdrive.report.table_figures import residuals


def facts(_run: RunData) -> list[Fact]:
    """Return nothing: what matters is not known."""
    return []


def summary(run: RunData) -> str:
    """Return what is there."""
    count = len(run.recordings)
    held = f"{count or 'no'} recording{'s' if count != 1 else ''}"
    if run.result:
        return f"The run made {held}. Its result as it stands in result.json:"
    return f"There is no result. The folder holds {held}."


def sections(run: RunData) -> list[Section]:
    """Return the numbers and texts of the result as tables, and the last recording."""
    return [*_tables("result", run.result), *_last_recording(run)]


def _tables(title: str, value: Mapping[str, Any]) -> list[Section]:
    """Return a table of an object's plain values, and one for each list or object within."""
    plain = [[key, _cell(item)] for key, item in value.items() if _is_plain(item)]
    shown = [Section(title, head=("", "value"), rows=plain)] if plain else []
    for key, item in value.items():
        if isinstance(item, Mapping):
            shown += _tables(f"{title}: {key}", item)
        elif not _is_plain(item):
            shown += [_list(f"{title}: {key}", item)]
    return shown


def _list(title: str, items: Sequence[Any]) -> Section:
    """Return a table with a row for each item and a column for each of their keys."""
    objects = [item if isinstance(item, Mapping) else {"value": item} for item in items]
    keys = list(dict.fromkeys(key for item in objects for key in item))
    rows = [[_cell(item.get(key, "")) for key in keys] for item in objects]
    return Section(title, head=keys, rows=rows)


def _is_plain(value: object) -> bool:
    return not isinstance(value, Mapping | list)


def _cell(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_cell(item)}" for key, item in value.items())
    if isinstance(value, list):
        return f"{len(value)} of them" if len(value) > 3 else ", ".join(map(_cell, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _last_recording(run: RunData) -> list[Section]:
    found = run.residual(run.recordings[-1]) if run.recordings else None
    if found is None:
        return []
    caption = "Every reading less a straight line: drift and noise included, nothing filtered."
    return [
        Section(
            "The last recording",
            residuals({f"{run.recordings[-1]}, {found.sensor}": found}),
            caption,
        )
    ]
