"""Plain scalars as YAML 1.2 has them: `1e-6` a number, `on` and `12:30` text, `010` ten."""

import math
import re

Scalar = str | int | float | bool | None

_NULLS = ("", "~", "null", "Null", "NULL")
_BOOLS = {
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INT = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_MOST_DIGITS = 18


def resolve(text: str) -> Scalar:
    """Return what a plain scalar stands for in the core schema.

    ValueError for numbers that are not finite or do not fit: `.nan`, `1e999`, 30-digit integers.
    """
    if text in _NULLS:
        return None
    if text in _BOOLS:
        return _BOOLS[text]
    if _NOT_FINITE.fullmatch(text):
        raise ValueError("a number must be finite")
    for pattern, base in ((_INT, 10), (_OCTAL, 8), (_HEX, 16)):
        if pattern.fullmatch(text):
            return _integer(text, base)
    return _number(text) if _FLOAT.fullmatch(text) else text


def reads_as_text(text: str) -> bool:
    """Say whether a plain scalar is text and not a number, a truth value or nothing."""
    try:
        return isinstance(resolve(text), str)
    except ValueError:
        return False


def _integer(text: str, base: int) -> int:
    digits = text.lstrip("+-").removeprefix("0o").removeprefix("0x").lstrip("0")
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"an integer has at most {_MOST_DIGITS} digits")
    return int(text, base)


def _number(text: str) -> float:
    value = float(text)
    mantissa = text.lower().partition("e")[0]
    if math.isinf(value) or (value == 0 and mantissa.strip("+-0.")):
        raise ValueError("too large or too small for a double")
    return value
