"""Write plain data as YAML that reads back the same under the rules of YAML 1.2."""

import re
from collections.abc import Iterator
from typing import Any

from labdrive.recipe.scalars import reads_as_text

_SAFE = re.compile(r"(-[0-9]|[A-Za-z0-9_./])[A-Za-z0-9_./ ^*()%+-]*(?<! )")


def yaml_text(data: dict[str, Any]) -> str:
    """Return a mapping of text, numbers, true, false, null, lists and mappings as YAML."""
    return "".join(f"{line}\n" for line in _mapping(data, ""))


def _mapping(data: dict[str, Any], indent: str) -> Iterator[str]:
    for key, value in data.items():
        if isinstance(value, dict) and value:
            yield f"{indent}{_scalar(key)}:"
            yield from _mapping(value, indent + "  ")
        else:
            yield f"{indent}{_scalar(key)}: {_flow(value)}"


def _flow(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_scalar(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(entry) for entry in value) + "]"
    return _scalar(value)


def _scalar(value: object) -> str:
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if not isinstance(value, str):
        return repr(value)
    if _SAFE.fullmatch(value) and reads_as_text(value):
        return value
    return '"' + "".join(_escaped(character) for character in value) + '"'


def _escaped(character: str) -> str:
    """Escape what double quotes cannot hold as it is: line breaks of any kind fold there."""
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08X}"
