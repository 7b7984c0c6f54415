"""`--set a.b=VALUE`: change a recipe before it is validated."""

from dataclasses import replace
from typing import Any

from labdrive.model.errors import Problem
from labdrive.recipe.source import FieldPath, Place, Source, dotted
from labdrive.recipe.yaml_source import compose


def apply_override(source: Source, text: str) -> None:
    """Put a value into a recipe's data; what is wrong is added to its problems."""
    label = f"--set {text}"
    name, equals, value = text.partition("=")
    parts = [part.strip() for part in name.split(".")]
    if not equals or not all(parts):
        cure = "write it as FIELD=VALUE, as in motion.periods=64"
        source.problems.append(Problem(cure, file=label))
        return
    override = compose(value, label) if value.strip() else Source(label, whole=True)
    for problem in override.problems:
        field = ".".join(part for part in (*parts, problem.field) if part)
        source.problems.append(replace(problem, field=field, line=0, column=0))
    if source.whole and not override.problems:
        _put(source, parts, override)


def _put(source: Source, parts: list[str], override: Source) -> None:
    """Walk to the place, making sections that are absent, and put the value there."""
    here, label = source.data, Place(override.label)
    path: FieldPath = ()
    for number, part in enumerate(parts, start=1):
        step = _step(here, part)
        if step is None:
            text = f"{dotted(path) or 'the recipe'} has no {part} that can be set"
            source.problems.append(Problem(text, file=override.label))
            return
        path = (*path, step)
        if number == len(parts):
            here[step] = override.data
            source.forget(path)
            source.values[path] = source.keys[path] = label
        elif isinstance(here, dict) and here.get(step) is None:
            here[step] = {}
            source.keys[path] = label
        here = here[step]


def _step(here: object, part: str) -> Any:
    """Return the key or index to go on with; None if there is no such place."""
    if isinstance(here, dict):
        return part
    known = {str(index): index for index in range(len(here))} if isinstance(here, list) else {}
    return known.get(part)
