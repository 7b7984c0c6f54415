"""`--set a.b=VALUE`: change a recipe before it is validated."""

from dataclasses import replace
from typing import Any

from labdrive.recipe.source import FieldPath, Place, Source, dotted
from labdrive.recipe.yaml_source import compose


def apply_override(source: Source, text: str) -> None:
    """Put a value into a recipe's data; what is wrong is added to its problems."""
    label = f"--set {text}"
    name, equals, value = text.partition("=")
    parts = [part.strip() for part in name.split(".")]
    override = compose(value, label) if value.strip() else Source(label, whole=True)
    if not equals or not all(parts):
        override.problems = [
            override.problem((), "write it as FIELD=VALUE, as in motion.periods=64")
        ]
    elif source.whole and not override.problems:
        _put(source, parts, override)
    plain = [replace(problem, file=label, line=0, column=0) for problem in override.problems]
    source.problems += plain


def _put(source: Source, parts: list[str], override: Source) -> None:
    """Walk to the place, making sections that are absent, and put the value there."""
    here, label = source.data, Place(override.label)
    path: FieldPath = ()
    for number, part in enumerate(parts, start=1):
        step: Any = int(part) if isinstance(here, list) and part.isdecimal() else part
        if not _has_room(here, step):
            what = "the recipe" if not path else dotted(path)
            override.problems.append(override.problem((), f"{what} has no {part} that can be set"))
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


def _has_room(here: object, step: str | int) -> bool:
    """Say whether a mapping can take this key, or a list has this entry."""
    return isinstance(here, dict) or (isinstance(here, list) and step in range(len(here)))
