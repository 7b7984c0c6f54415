import math
from contextlib import suppress
from decimal import Decimal

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from labdrive.model.errors import InputError
from labdrive.model.unit_symbols import PREFIXED, PREFIXES, SYMBOLS
from labdrive.model.units import canonical_unit, format_si, parse, parse_unit

SI_UNITS = [
    "m", "V", "Hz", "N", "s", "rad", "m/s", "V/s", "A", "F", "Ohm", "N/m", "m/V", "m/sqrt(s)",
    "kg", "K", "N*s/m", "N*m", "Pa", "J", "W", "count", "px", "1", "1/s", "m^2", "rad/count",
    "kg/m^3", "N/(m*s)",
]  # fmt: skip

finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("5 um", 5e-6, "m"),
        ("5µm", 5e-6, "m"),
        ("5 μm", 5e-6, "m"),
        ("1.2207 nm", 1.2207e-9, "m"),
        ("0.3 nm/sqrt(s)", 3e-10, "m/sqrt(s)"),
        ("100 N/um", 1e8, "N/m"),
        ("0.036 um/V", 3.6e-8, "m/V"),
        ("250 g", 0.25, "kg"),
        ("90 min", 5400.0, "s"),
        ("1.5 h", 5400.0, "s"),
        ("90 deg", math.pi / 2, "rad"),
        ("90°", math.pi / 2, "rad"),
        ("1 rev", 2 * math.pi, "rad"),
        ("3600 arcsec", math.pi / 180, "rad"),
        ("60 arcmin", math.pi / 180, "rad"),
        ("120 rev/min", 4 * math.pi, "rad/s"),
        ("12.5 %", 0.125, "1"),
        ("3 1", 3.0, "1"),
        ("5 /s", 5.0, "Hz"),
        ("5 1/s", 5.0, "Hz"),
        ("2 mm²", 2e-6, "m^2"),
        ("2 mm^2", 2e-6, "m^2"),
        ("2 mm⁻¹", 2e3, "1/m"),
        ("20 N s/m", 20.0, "N*s/m"),
        ("20 N·s/m", 20.0, "N*s/m"),
        ("4 kΩ", 4e3, "Ohm"),
        ("-1e-3 V", -1e-3, "V"),
        ("+.5e1 V", 5.0, "V"),
        ("5. V", 5.0, "V"),
        ("3 nm/sqrt(Hz)", 3e-9, "m*sqrt(s)"),
        ("1 W/(m*K)", 1.0, "W/(m*K)"),
    ],
)
def test_text_becomes_si(text, value, unit):
    assert parse(text) == (value, parse_unit(unit).dimension)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 M", "no unit M; did you mean m?"),
        ("5 khz", "no unit khz; did you mean kHz?"),
        ("5 counts", "no unit counts; did you mean count?"),
        ("5 C", "no unit C: write K for a temperature, A*s for a charge"),
        ("5 rpm", "no unit rpm: write rev/min"),
        ("5 sec", "no unit sec: write s for seconds, arcsec for an angle"),
        ("5", "a number without a unit"),
        ("um", "not a number with a unit, as in 5 um"),
        ("nan m", "not a number with a unit, as in 5 um"),
        ("inf m", "not a number with a unit, as in 5 um"),
        ("1_000 m", "'_000 m' is not a unit: '_' has no place in one; powers are as in m^2"),
        ("1,5 m", "',5 m' is not a unit: ',' has no place in one; powers are as in m^2"),
        ("٣ m", "not a number with a unit, as in 5 um"),
        ("5 mm2", "'mm2' is not a unit: '2' has no place in one; powers are as in m^2"),
        ("5 m^0", "'m^0' is not a unit: powers go from 1 to 9, either sign"),
        ("5 m^99", "'m^99' is not a unit: powers go from 1 to 9, either sign"),
        ("5 (m", "'(m' is not a unit: a ) is missing"),
        ("5 m)", "'m)' is not a unit: ')' is out of place"),
        ("5 V/", "'V/' is not a unit: it breaks off"),
        ("5 sqrt(sqrt(s))", "'sqrt(sqrt(s))' is not a unit: it has a root within a root"),
        ("1e999 m", "too large or too small for a double"),
        ("1e-999 m", "too large or too small for a double"),
        ("1e99999999999999999999 m", "too large or too small for a double"),
    ],
)
def test_what_is_not_clear_is_refused_with_a_cure(text, message):
    with pytest.raises(InputError) as refused:
        parse(text)
    assert str(refused.value) == message


@pytest.mark.parametrize("text", ["1 N/m/s", "1 N/m*s", "1 J/kg K"])
def test_what_follows_a_quotient_could_be_read_in_two_ways(text):
    with pytest.raises(InputError, match=r"could be read in two ways; write a/\(b\*c\) or a\*c/b"):
        parse(text)


@pytest.mark.parametrize("symbol", ["degC", "°C", "degF"])
def test_units_with_an_offset_say_why_not(symbol):
    with pytest.raises(InputError, match="its zero is not that of K"):
        parse(f"20 {symbol}")


@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**12), max_value=10**12))
def test_scaling_is_exact(number):
    assert parse(f"{number} um")[0] == float(number.scaleb(-6))


@given(finite, st.sampled_from(SI_UNITS))
@example(5e-324, "m")
@example(1.7976931348623157e308, "kg")
@example(-0.0, "V")
@example(0.0, "kg")
def test_text_reads_back_as_the_very_double(value, unit):
    back, dimension = parse(format_si(value, unit))
    assert (back, math.copysign(1, back)) == (value, math.copysign(1, value))
    assert dimension == parse_unit(unit).dimension


@given(st.floats(min_value=1e-23, max_value=1e23), st.sampled_from(["m", "V", "N", "kg", "Hz"]))
def test_engineers_read_between_one_and_a_thousand(value, unit):
    number = Decimal(format_si(value, unit).split()[0])
    assert 1 <= number < 1000


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (5e-6, "m", "5 um"),
        (3.6e-8, "m/V", "36 nm/V"),
        (0.1, "kg", "100 g"),
        (3600, "s", "3600 s"),
        (1e8, "N/m", "100 MN/m"),
        (3e-10, "m/sqrt(s)", "300 pm/sqrt(s)"),
        (1e-12, "m^2", "1e-12 m^2"),
        (250, "1/s", "250 1/s"),
    ],
)
def test_text_as_an_engineer_would_write_it(value, unit, text):
    assert format_si(value, unit) == text


@pytest.mark.parametrize(("value", "unit"), [(math.nan, "m"), (math.inf, "m"), (1.0, "mm")])
def test_only_finite_si_can_be_written(value, unit):
    with pytest.raises(ValueError, match="coherent SI unit"):
        format_si(value, unit)


@given(st.lists(st.sampled_from(sorted(SYMBOLS)), min_size=1, max_size=3), st.booleans())
@example(["m", "kg", "s", "A", "K", "rad", "count", "px"], True)
def test_canonical_unit_is_si_of_the_same_dimension(symbols, root):
    product = "*".join(symbols)
    try:
        dimension = parse_unit(f"sqrt({product})" if root else product).dimension
    except InputError:
        assume(False)
    canonical = parse_unit(canonical_unit(dimension))
    assert (canonical.size, canonical.dimension) == (1, dimension)


def test_powers_have_an_end():
    with pytest.raises(InputError, match=r"'\(m\^5\)\^2' goes beyond the power 9 of a base unit"):
        parse_unit("(m^5)^2")


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("1 N/um", "N/m"),
        ("1 deg/count", "rad/count"),
        ("1 nm/sqrt(s)", "m/sqrt(s)"),
        ("1 %", "1"),
        ("1 mm^2", "m^2"),
        ("1 rev/min", "rad/s"),
        ("1 W/(m*K)", "m*kg/(s^3*K)"),
    ],
)
def test_canonical_units_read_well(text, unit):
    assert canonical_unit(parse(text)[1]) == unit


def test_no_two_units_share_a_symbol():
    made = [prefix + symbol for prefix in ("", *PREFIXES) for symbol in PREFIXED]
    assert len(made) == len(set(made))


@given(st.text(max_size=80))
@example("5 " + "(" * 50)
def test_any_text_is_read_or_refused(text):
    with suppress(InputError):
        assert math.isfinite(parse(text)[0])
