"""Recompute a run from its journal: the same questions must get the same result, bit for bit."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from labdrive.engine.journal_bench import JournalBench
from labdrive.engine.plan import prepare
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.errors import ReplayError, StoreError
from labdrive.recipe.load import load
from labdrive.store.run_folder import RunFolder


def replay(folder: RunFolder, plugins: PluginSet) -> Mapping[str, Any]:
    """Run the experiment of a run again on its recordings; return the result. Nothing moves.

    ReplayError, naming the step, if the experiment asks for something else than it did, if a
    recording it asks for was never made, or if the result differs. StoreError if a recording, the
    journal or result.json is damaged.
    """
    path = folder.path
    loaded = load(path / "recipe.yaml", plugins, path / "bench.yaml", ())
    prepared = prepare(loaded, plugins)
    result = dict(prepared.experiment.run(JournalBench(prepared, path)))
    _compare(folder, result)
    return result


def _compare(folder: RunFolder, result: Mapping[str, Any]) -> None:
    """Raise ReplayError at the first place where the result is not that of result.json."""
    path = folder.path / "result.json"
    if not path.is_file():
        raise ReplayError(f"{path} is missing: the run never came to a result to compare with")
    try:
        was = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    for place, before, now in _differences("", was, json.loads(json.dumps(result))):
        raise ReplayError(f"the result differs at {place}: the run had {before}, the replay {now}")


def _differences(place: str, before: Any, now: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield (place, before, now) wherever two JSON values differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in {**before, **now}:
            inner = f"{place}.{key}".lstrip(".")
            yield from _differences(inner, before.get(key), now.get(key))
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for index, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from _differences(f"{place}[{index}]", one, other)
    elif before != now:
        yield place, before, now
