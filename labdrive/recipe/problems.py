"""What pydantic found, told in plain words at the line it stands on."""

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from labdrive.model.errors import InputError, Problem
from labdrive.model.units import canonical_unit, format_si, parse
from labdrive.model.wording import guess, listed, no_such
from labdrive.recipe.fields import fields_at
from labdrive.recipe.models import TAG
from labdrive.recipe.scalars import reads_as_text
from labdrive.recipe.source import FieldPath, Source, dotted

_LONGEST_SHOWN = 60

_WORDS = {
    "missing": "missing",
    "bool_type": "must be true or false",
    "string_type": "must be text; quotes make it so",
    "model_type": "must be a mapping of fields",
    "model_attributes_type": "must be a mapping of fields",
    "dict_type": "must be a mapping of names",
    "finite_number": "must be finite",
} | {
    kind: words
    for kinds, words in {
        ("int_type", "int_parsing", "int_from_float"): "must be a whole number",
        ("float_type", "float_parsing"): "must be a number",
        ("list_type", "tuple_type", "set_type", "frozen_set_type"): "must be a list",
    }.items()
    for kind in kinds
}
_BOUNDS = {
    "greater_than": ("gt", "must be above {}"),
    "greater_than_equal": ("ge", "must be {} or more"),
    "less_than": ("lt", "must be below {}"),
    "less_than_equal": ("le", "must be {} or less"),
}
_BAD_NAME = "a name begins with a letter and goes on with letters, digits, _ or -"


def problems_of(error: ValidationError, source: Source, root: object) -> list[Problem]:
    """Return a problem a field; `root` is the type that was validated."""
    told = {problem.field for problem in source.problems if problem.field}
    found: dict[tuple[FieldPath, bool], list[str]] = {}
    for detail in error.errors(include_url=False):
        path, of_key = _field_path(detail, source.data)
        if dotted(path) not in told:
            text = _words(detail, path, source.data, root)
            words = found.setdefault((path, of_key), [])
            words += [text] if text not in words else []
    return [_problem(source, path, of_key, words) for (path, of_key), words in found.items()]


def _problem(source: Source, path: FieldPath, of_key: bool, words: list[str]) -> Problem:
    present, value = value_at(source.data, path)
    shown = shown_value(value) if present and not of_key else None
    message = "; or it ".join(sorted(words, key=lambda text: text.startswith("must ")))
    return source.problem(path, message, shown, key=of_key)


def _field_path(detail: ErrorDetails, data: object) -> tuple[FieldPath, bool]:
    """Return the path of the field, without names of choices, and whether its name is wrong."""
    path: FieldPath = ()
    for part in detail["loc"]:
        if not str(part).startswith(TAG) and value_at(data, (*path, part))[0]:
            path = (*path, part)
    if detail["type"] == "missing":
        path = (*path, detail["loc"][-1])
    if detail["type"] in ("choice_missing", "choice_unknown"):
        path = (*path, detail["ctx"]["key"])
    return path, detail["type"] == "extra_forbidden" or detail["loc"][-1:] == ("[key]",)


def value_at(data: object, path: FieldPath) -> tuple[bool, object]:
    """Return whether there is a value at `path`, and the value."""
    for part in path:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and part in range(len(data)):
            data = data[int(part)]
        else:
            return False, None
    return True, data


def shown_value(value: object) -> str | None:
    """Return a value as its file might have it; None for a mapping or list, which says little."""
    if isinstance(value, dict | list):
        return None
    if value is None or isinstance(value, bool):
        return "nothing" if value is None else str(value).lower()
    text = str(value)
    plain = text.isprintable() and text == text.strip() and reads_as_text(text)
    text = repr(text) if isinstance(value, str) and not plain else text
    return text if len(text) <= _LONGEST_SHOWN else text[:_LONGEST_SHOWN] + "..."


def _words(detail: ErrorDetails, path: FieldPath, data: object, root: object) -> str:
    kind, context, (_, value) = detail["type"], detail.get("ctx", {}), value_at(data, path)
    if kind == "extra_forbidden":
        return no_such("field", str(path[-1]), fields_at(root, detail["loc"][:-1]))
    if kind == "string_pattern_mismatch" and detail["loc"][-1] == "[key]":
        return _BAD_NAME
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        return words.format(_in_unit_of(value, context[bound]))
    if kind == "too_short":
        least = context["min_length"]
        return f"must have {least} entries or more" if least > 1 else "must not be empty"
    if kind in ("literal_error", "enum"):
        return _one_of(context["expected"], value)
    return _WORDS.get(kind) or _mended(detail["msg"])


def _in_unit_of(value: object, bound: Any) -> str:
    """Write a bound with the unit of the value that was held against it."""
    try:
        return format_si(bound, canonical_unit(parse(str(value))[1]))
    except InputError:
        return f"{bound:g}"


def _one_of(expected: str, value: object) -> str:
    names = re.findall(r"'([^']*)'", expected) or [expected]
    return f"must be {listed(names)}" + (guess(value, names) if isinstance(value, str) else "")


def _mended(message: str) -> str:
    """Take pydantic's way of speaking out of a message."""
    message = message.removeprefix("Value error, ").removeprefix("Assertion failed, ")
    return re.sub(r"^(Input|Value|String|List|Tuple|Dictionary) should ", "must ", message)
