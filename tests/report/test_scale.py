"""Numbers as people read them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.report.scale import readable, scale_for, significant


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (2.32e-7, "m", 3, "232 nm"),
        (1.27e-10, "m", 3, "127 pm"),
        (0.99999999e-3, "m", 6, "1.00000 mm"),
        (4.44198e-6, "m", 6, "4.44198 µm"),
        (math.radians(1.26), "rad", 3, "1.26 deg"),
        (math.radians(3.8 / 3600), "rad", 2, "3.8 arcsec"),
        (0.0, "m", 3, "0 pm"),
        (12.5, "K", 3, "12.5 K"),
    ],
)
def test_a_value_is_told_in_the_unit_that_reads_best(value, unit, digits, text):
    assert readable(value, unit, digits) == text


@given(st.floats(1e-12, 1e3), st.integers(1, 8))
def test_what_is_told_is_the_value_to_so_many_digits(value, digits):
    scale = scale_for("m", value)
    told = float(scale.text(value, digits).split()[0]) * scale.size
    assert told == pytest.approx(value, rel=0.51 * 10 ** (1 - digits))


@given(st.floats(-1e9, 1e9), st.integers(1, 8))
def test_significant_digits_are_those_asked_for(value, digits):
    assert float(significant(value, digits)) == float(f"{value:.{digits}g}")
