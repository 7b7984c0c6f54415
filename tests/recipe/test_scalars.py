import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.recipe.scalars import resolve

# Table 10.2.1 of the YAML 1.2.2 specification, as it is printed.
CORE_INT = r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"
CORE_FLOAT = r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
CORE_OTHER = (
    r"null|Null|NULL|~||true|True|TRUE|false|False|FALSE"
    r"|[-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN"
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("-1.5E+3", -1500.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("010", 10),
        ("0o10", 8),
        ("0x1F", 31),
        ("-0", 0),
        ("+7", 7),
        ("true", True),
        ("FALSE", False),
        ("", None),
        ("~", None),
        ("Null", None),
        ("on", "on"),
        ("yes", "yes"),
        ("n", "n"),
        ("12:30", "12:30"),
        ("1_000", "1_000"),
        ("0b11", "0b11"),
        ("-0o7", "-0o7"),
        ("2026-11-20", "2026-11-20"),
        ("1.2.3", "1.2.3"),
        ("5 um", "5 um"),
        ("٣", "٣"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text, value):
    resolved = resolve(text)
    assert (resolved, type(resolved)) == (value, type(value))


@pytest.mark.parametrize("text", [".nan", ".NaN", ".inf", "-.Inf", "+.INF", "1e999", "1e-999"])
def test_numbers_must_be_finite_and_fit(text):
    with pytest.raises(ValueError, match=r"finite|double"):
        resolve(text)


@pytest.mark.parametrize("text", ["1" * 19, "0x" + "f" * 19])
def test_integers_have_a_size(text):
    with pytest.raises(ValueError, match="an integer has at most 18 digits"):
        resolve(text)


@given(st.from_regex(CORE_INT, fullmatch=True).filter(lambda text: len(text) < 18))
def test_integers_of_the_core_schema(text):
    base = {"0o": 8, "0x": 16}.get(text[:2], 10)
    assert resolve(text) == int(text, base)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_doubles_survive(value):
    assert resolve(repr(value)) == value


@given(st.text(alphabet="0123456789.eE+-xo_:~ natrulf", max_size=8))
def test_whatever_the_core_schema_does_not_name_is_text(text):
    if not re.fullmatch(f"{CORE_INT}|{CORE_FLOAT}|{CORE_OTHER}", text):
        assert resolve(text) == text


@given(st.from_regex(CORE_FLOAT, fullmatch=True).filter(lambda text: len(text) < 18))
def test_whatever_the_core_schema_calls_a_number_is_one(text):
    try:
        assert resolve(text) == float(text)
    except ValueError:
        assert float(text) in (0, math.inf, -math.inf)
