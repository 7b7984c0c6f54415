"""Read a recipe and its bench, validate both, and remember where everything stood."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.errors import InputError, Problem
from labdrive.recipe.models import bench_model, recipe_model
from labdrive.recipe.overrides import apply_override
from labdrive.recipe.problems import problems_of, shown_value, value_at
from labdrive.recipe.source import FieldPath, Source
from labdrive.recipe.yaml_source import compose, read
from labdrive.recipe.yaml_text import yaml_text

_FIRST = ("kind", "plugin", "use", "title", "bench", "actuator", "seed")


@dataclass(frozen=True)
class Loaded:
    """A recipe and its bench, validated.

    `recipe` is an instance of its kind's `Settings` with `kind`, `title`, `bench`, `actuator` and
    `seed`; `bench` has `links`, `actuators`, `sensors` (settings by name) and `limits`.
    """

    recipe: Any
    bench: Any
    recipe_path: Path
    bench_path: Path
    _recipe_source: Source = field(repr=False, compare=False)
    _bench_source: Source = field(repr=False, compare=False)

    def problem(
        self,
        where: Literal["recipe", "bench"],
        field_path: str,
        message: str,
        got: object = None,
    ) -> Problem:
        """Return a problem that points at a field, or at what is above it if it is not given."""
        source = self._recipe_source if where == "recipe" else self._bench_source
        path = _path_in(source.data, field_path)
        return source.problem(path, message, None if got is None else shown_value(got))

    def resolved_recipe(self) -> str:
        """Return the recipe as YAML, every default filled in, paths absolute."""
        return yaml_text(_ordered(self.recipe.model_dump(mode="json")))

    def resolved_bench(self) -> str:
        """Return the bench as YAML, every default filled in, paths absolute."""
        return yaml_text(_ordered(self.bench.model_dump(mode="json")))


def load(
    recipe_path: Path | str,
    plugins: PluginSet,
    bench: Path | str | None = None,
    overrides: Sequence[str] = (),
) -> Loaded:
    """Read and validate a recipe and its bench; InputError with every problem found.

    `bench` takes the place of the recipe's; `overrides` are `a.b=VALUE`, VALUE as in YAML.
    """
    recipe_path = Path(recipe_path)
    source = read(recipe_path)
    for override in overrides:
        apply_override(source, override)
    bench_path = _bench_path(source, recipe_path.parent, bench)
    context = {"folder": recipe_path.parent, "trajectories": plugins.trajectories}
    recipe, problems = _validated(source, recipe_model(plugins), context)
    if bench_path is None:
        raise InputError(*problems)
    bench_source = read(bench_path)
    settings, bench_problems = _validated(
        bench_source, bench_model(plugins), {"folder": bench_path.parent}
    )
    if problems or bench_problems:
        raise InputError(*problems, *bench_problems)
    recipe = recipe.model_copy(update={"bench": str(bench_path.resolve())})
    return Loaded(recipe, settings, recipe_path, bench_path, source, bench_source)


def load_bench(path: Path | str, plugins: PluginSet) -> Any:
    """Read and validate a bench alone; InputError with every problem found."""
    settings, problems = _validated(
        read(Path(path)), bench_model(plugins), {"folder": Path(path).parent}
    )
    if problems:
        raise InputError(*problems)
    return settings


def load_file(path: Path | str, model: Any) -> Any:
    """Read and validate a YAML file of another kind; InputError with every problem found."""
    return _or_raise(read(Path(path)), model, Path(path).parent)


def load_fields(fields: Mapping[str, Any], label: str, model: Any) -> Any:
    """Validate fields that were given on the command line; InputError with every problem found."""
    return _or_raise(compose(json.dumps(dict(fields)), label), model, Path())


def _or_raise(source: Source, model: Any, folder: Path) -> Any:
    settings, problems = _validated(source, model, {"folder": folder})
    if problems:
        raise InputError(*problems)
    return settings


def _validated(source: Source, model: Any, context: Mapping[str, Any]) -> tuple[Any, list[Problem]]:
    """Return the settings, or None and the problems.

    Strict validation of JSON takes text for paths and choices, as files have them, but no text for
    numbers and no numbers for text.
    """
    if not source.whole:
        return None, source.problems
    if not isinstance(source.data, dict):
        return None, [*source.problems, source.problem((), "must be a mapping of fields")]
    adapter: TypeAdapter[Any] = TypeAdapter(model)
    text, settings, found = json.dumps(source.data), None, source.problems
    try:
        settings = adapter.validate_json(text, strict=True, context=dict(context))
    except ValidationError as error:
        found = found + problems_of(error, source, model)
    return settings, sorted(found, key=lambda problem: (problem.line, problem.column))


def _bench_path(source: Source, folder: Path, override: Path | str | None) -> Path | None:
    """Return the path of the bench; None, with the problem noted, if the recipe gives none."""
    if override is not None:
        return Path(override)
    if not isinstance(source.data, dict):
        return None
    named = source.data.get("bench")
    if isinstance(named, str) and named:
        path = Path(os.path.normpath(folder / named))
        if path.is_file():
            return path
        source.problems.append(source.problem(("bench",), f"there is no file {path}", named))
    elif named is None:
        text = "missing; name a bench file here, or with --bench"
        source.problems.append(source.problem(("bench",), text))
    return None


def _path_in(data: Any, field_path: str) -> FieldPath:
    """Return a dotted path with the indices of lists as numbers."""
    path: FieldPath = ()
    for part in field_path.split(".") if field_path else ():
        at_list = isinstance(value_at(data, path)[1], list) and part.isdigit()
        path = (*path, int(part) if at_list else part)
    return path


def _ordered(data: Any) -> Any:
    """Put what tells plugins apart, and what a reader looks for first, at the top."""
    if isinstance(data, list):
        return [_ordered(entry) for entry in data]
    if not isinstance(data, dict):
        return data
    names = [name for name in _FIRST if name in data]
    return {name: _ordered(data[name]) for name in dict.fromkeys([*names, *data])}
