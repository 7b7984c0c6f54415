"""Numbers with units as text: `5 um`, `36 nm/V`, `0.3 nm/sqrt(s)`, to SI doubles and back.

The grammar is small so that nothing surprises: products by `*`, `·` or a space, one quotient by `/`
(parentheses where the denominator is a product), whole powers by `^2` or `²`, and `sqrt(...)`.
What could be read in two ways is an error. Scaling is done in decimal, so that `5 um` is the double
nearest to 5e-6.
"""

import difflib
import math
import re
from collections.abc import Iterator
from decimal import Decimal, DecimalException
from functools import lru_cache
from itertools import product
from typing import NoReturn

from labdrive.model.errors import InputError
from labdrive.model.unit_symbols import (
    BASE_UNITS,
    DECIMAL,
    PREFIXED,
    PREFIXES,
    SYMBOLS,
    Dimension,
    Unit,
)

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_TOKEN = re.compile(r"\s*([A-Za-zµμΩ\u2126]+|°[CF]?|[%1]|\^[+-]?[0-9]+|⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+|[*·/()])\s*")
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_LONGEST_UNIT = 200
_MOST_PARENTHESES = 12
_HIGHEST_POWER = 9

_OFFSET = "its zero is not that of K, so a temperature and a difference would differ; write K"
_REMEDIES = {
    "C": "write K for a temperature, A*s for a charge",
    "degC": _OFFSET,
    "°C": _OFFSET,
    "degF": _OFFSET,
    "°F": _OFFSET,
    "sec": "write s for seconds, arcsec for an angle",
    "rpm": "write rev/min",
    "u": "a prefix alone is no unit; did you mean um?",
}


def parse(text: str) -> tuple[float, Dimension]:
    """Return the value in coherent SI and its dimension; InputError if `text` is not clear."""
    number = _NUMBER.match(text.strip())
    if number is None:
        raise InputError("not a number with a unit, as in 5 um")
    rest = text.strip()[number.end() :].strip()
    if not rest:
        raise InputError("a number without a unit")
    unit = parse_unit("1" + rest if rest.startswith("/") else rest)
    return _nearest_double(number.group(), unit), unit.dimension


def _nearest_double(number: str, unit: Unit) -> float:
    try:
        value = float(DECIMAL.multiply(Decimal(number), unit.size))
    except (DecimalException, OverflowError):
        value = math.inf
    mantissa = number.lower().partition("e")[0]
    if math.isinf(value) or (value == 0 and mantissa.strip("+-0.")):
        raise InputError("too large or too small for a double")
    return value


@lru_cache(maxsize=256)
def parse_unit(text: str) -> Unit:
    """Return the unit that `text` names; InputError, with a suggestion, if it names none."""
    if len(text) > _LONGEST_UNIT or text.count("(") > _MOST_PARENTHESES:
        raise InputError(f"{text[:20]!r}... is too long for a unit")
    unit = _Parser(text).whole()
    if any(abs(exponent) > _HIGHEST_POWER for exponent in unit.dimension):
        raise InputError(f"{text!r} goes beyond the power {_HIGHEST_POWER} of a base unit")
    return unit


class _Parser:
    """Recursive descent over the tokens of a unit."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = list(self._split())

    def _split(self) -> Iterator[str]:
        position = 0
        while position < len(self._text):
            token = _TOKEN.match(self._text, position)
            if token is None:
                self._refuse(f"{self._text[position]!r} has no place in one; powers are as in m^2")
            yield token.group(1)
            position = token.end()

    def whole(self) -> Unit:
        unit = self._quotient()
        if self._tokens:
            self._refuse(f"{self._tokens[0]!r} is out of place")
        return unit

    def _refuse(self, why: str) -> NoReturn:
        raise InputError(f"{self._text!r} is not a unit: {why}")

    def _next_is(self, tokens: str) -> bool:
        return bool(self._tokens) and self._tokens[0] in tokens

    def _quotient(self) -> Unit:
        numerator = self._product()
        if not self._next_is("/"):
            return numerator
        self._tokens.pop(0)
        denominator = self._power()
        if self._tokens and not self._next_is(")"):
            self._refuse("what follows the / could be read in two ways; write a/(b*c) or a*c/b")
        return numerator.times(denominator.power(-1))

    def _product(self) -> Unit:
        unit = self._power()
        while self._tokens and not self._next_is("/)"):
            if self._next_is("*·"):
                self._tokens.pop(0)
            unit = unit.times(self._power())
        return unit

    def _power(self) -> Unit:
        unit = self._atom()
        if not self._tokens or self._tokens[0][0] not in "^⁻⁰¹²³⁴⁵⁶⁷⁸⁹":
            return unit
        exponent = int(self._tokens.pop(0).lstrip("^").translate(_SUPERSCRIPTS))
        if exponent == 0 or abs(exponent) > _HIGHEST_POWER:
            self._refuse(f"powers go from 1 to {_HIGHEST_POWER}, either sign")
        return unit.power(exponent)

    def _atom(self) -> Unit:
        if not self._tokens:
            self._refuse("it breaks off")
        symbol = self._tokens.pop(0)
        if symbol == "sqrt" and self._next_is("("):
            self._tokens.pop(0)
            return self._root(self._parenthesis())
        if symbol == "(":
            return self._parenthesis()
        if symbol not in SYMBOLS:
            raise InputError(f"no unit {symbol}{_suggestion(symbol)}")
        return SYMBOLS[symbol]

    def _root(self, unit: Unit) -> Unit:
        if any(exponent % 1 for exponent in unit.dimension):
            self._refuse("it has a root within a root")
        return unit.power(0.5)

    def _parenthesis(self) -> Unit:
        unit = self._quotient()
        if not self._next_is(")"):
            self._refuse("a ) is missing")
        self._tokens.pop(0)
        return unit


def _suggestion(token: str) -> str:
    if token in _REMEDIES:
        return f": {_REMEDIES[token]}"
    same = [symbol for symbol in SYMBOLS if symbol.lower() == token.lower()]
    close = same or difflib.get_close_matches(token, SYMBOLS, n=2, cutoff=0.7)
    return f"; did you mean {' or '.join(close[:2])}?" if close else ""


_ENGINEERING = {exponent: prefix for prefix, exponent in PREFIXES.items()} | {0: ""}
_LEAD = re.compile(r"(kg|[A-Za-z]+)(?![\^⁻⁰¹²³⁴⁵⁶⁷⁸⁹(A-Za-z])")
_NO_LARGE_PREFIX = ("s", "K", "rad")


def format_si(value: float, unit: str, significant: int | None = None) -> str:
    """Return text that `parse` takes back to the very double, with an engineering prefix.

    With `significant` digits it is rounded to those instead, for people to read.

    `unit` is coherent SI, as in `m`, `N/m`, `m/sqrt(s)`; ValueError otherwise, or if `value` is
    not finite.
    """
    if not math.isfinite(value) or parse_unit(unit).size != 1:
        raise ValueError(f"{value} {unit}: a finite number and a coherent SI unit are due")
    rounded = float(value) if significant is None else float(f"{value:.{significant}g}")
    digits = Decimal(repr(rounded))
    lead = _LEAD.match(unit)
    if lead is None or lead.group(1) not in (*PREFIXED, "kg"):
        return f"{_plain(digits)} {unit}"
    symbol, shift = ("g", 3) if lead.group(1) == "kg" else (lead.group(1), 0)
    exponent = _engineering_exponent(digits.scaleb(shift), symbol)
    scaled = _plain(digits.scaleb(shift - exponent))
    return f"{scaled} {_ENGINEERING[exponent]}{symbol}{unit[lead.end() :]}"


def _engineering_exponent(digits: Decimal, symbol: str) -> int:
    if digits == 0:
        return 3 if symbol == "g" else 0
    most = 0 if symbol in _NO_LARGE_PREFIX else 24
    return max(-24, min(most, digits.adjusted() // 3 * 3))


def _plain(digits: Decimal) -> str:
    """Write without an exponent where that stays short."""
    short = -5 < digits.adjusted() < 7
    return format(digits.normalize(), "f" if short else "e") if digits else format(digits, ".0f")


_DERIVED = ("N", "V", "F", "Ohm", "Pa", "J", "W", "Hz")
_PER = ("m", "s", "rad", "count", "px", "V", "N", "A", "K")


@lru_cache(maxsize=256)
def canonical_unit(dimension: Dimension) -> str:
    """Return the coherent SI unit of a dimension as engineers write it: `N/m`, `m/sqrt(s)`."""
    quotients = (f"{a}/{b}" for a, b in product((*BASE_UNITS, *_DERIVED), _PER))
    one_base = sum(map(bool, dimension)) <= 1
    for text in _DERIVED if one_base else (*_DERIVED, *quotients):
        if parse_unit(text).dimension == dimension:
            return text
    above, below = _powers(dimension, 1), _powers(dimension, -1)
    bottom = "*".join(below) if len(below) == 1 else f"({'*'.join(below)})"
    return ("*".join(above) or "1") + (f"/{bottom}" if below else "")


def _powers(dimension: Dimension, sign: int) -> list[str]:
    """Return the factors above (sign 1) or below (-1) the line."""
    factors = []
    for base, exponent in zip(BASE_UNITS, dimension, strict=True):
        whole, half = divmod(max(0.0, sign * exponent), 1)
        factors += [base if whole == 1 else f"{base}^{whole:.0f}"] * bool(whole)
        factors += [f"sqrt({base})"] * bool(half)
    return factors
