import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.report.decimate import decimate
from labdrive.report.entries import error_over_cycle
from labdrive.report.palette import COLOUR, PALETTE, STEPS, sequence
from labdrive.report.scale import readable, scale_for, significant

NBSP = "\N{NO-BREAK SPACE}"
ARCSEC = np.pi / 648000
curves = arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6))


@given(y=curves, points=st.integers(4, 60))
def test_decimation_keeps_ends_extremes_and_order_in_few_points(y, points):
    x = np.arange(len(y), dtype=float)
    kept, values = decimate(x, y, points)
    assert len(kept) <= points
    assert np.all(np.diff(kept) > 0)
    assert np.array_equal(values, y[kept.astype(int)])
    assert (kept[0], kept[-1]) == (0, len(y) - 1)
    assert (values.min(), values.max()) == (y.min(), y.max())


@given(y=curves, points=st.integers(4, 60))
def test_decimation_keeps_the_extremes_of_any_window_to_a_stretch(y, points):
    """What is seen around a sample must reach as far as the sample did."""
    x = np.arange(len(y), dtype=float)
    kept, values = decimate(x, y, points)
    stretch = len(y) / (points // 2 - 1) + 1
    for sample in range(0, len(y), 17):
        near = values[np.abs(kept - sample) <= stretch]
        assert near.min() <= y[sample] <= near.max()


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(-np.pi, np.pi)), min_size=1, max_size=40))
def test_the_curve_is_the_sum_of_its_cosines(harmonics):
    entry = {
        "harmonics": [
            {"k": k, "amplitude": a, "phase": p} for k, (a, p) in enumerate(harmonics, start=1)
        ]
    }
    curve = error_over_cycle(entry)
    phase = np.linspace(0, 2 * np.pi, len(curve))
    direct = sum(a * np.cos(k * phase + p) for k, (a, p) in enumerate(harmonics, start=1))
    assert curve == pytest.approx(direct, abs=1e-11)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2.32e-7, "m", "232 nm"),
        (-4.4678e-6, "m", "−4.47 µm"),
        (9.999e-7, "m", "1.00 µm"),
        (1.3e-10, "m", "130 pm"),
        (0.0, "m", "0 pm"),
        (2.71 * ARCSEC, "rad", "2.71 arcsec"),
        (0.02 * ARCSEC, "rad", "20.0 mas"),
        (np.radians(1.38), "rad", "1.38 deg"),
        (47.95, "V", "48.0 V"),
        (3.0, "furlong", "3.00 furlong"),
    ],
)
def test_units_fit_the_size(value, unit, text):
    assert readable(value, unit) == text.replace(" ", NBSP)


@given(st.floats(1e-13, 1e3), st.sampled_from(["m", "rad", "V", "N"]))
def test_what_is_read_is_the_value_to_three_digits(value, unit):
    scale = scale_for(unit, float(f"{value:.3g}"))
    shown = float(readable(value, unit).split(NBSP)[0].replace("−", "-"))
    assert shown * scale.size == pytest.approx(value, rel=6e-3)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (4.467753e-6, 1.3e-10, ("4.46775", "0.00013")),
        (3.2e-8, 2.5e-6, ("0.0", "2.5")),
        (1.5e-6, 0.0, ("1.50000", "0")),
    ],
)
def test_an_error_says_how_many_digits_a_value_has(value, error, text):
    assert scale_for("m", 1e-6).measured(value, error) == text


def test_decades_have_short_numbers_and_prefixes():
    micrometre, degree = scale_for("m", 1e-6), scale_for("rad", 0.1)
    assert [micrometre.decade(10.0**n) for n in (-5, -3, -1, 0, 3)] == [
        f"10{NBSP}pm",
        f"1{NBSP}nm",
        f"100{NBSP}nm",
        f"1{NBSP}µm",
        f"1{NBSP}mm",
    ]
    assert degree.decade(0.01) == f"0.01{NBSP}deg"


@given(st.floats(-1e9, 1e9), st.integers(1, 8))
def test_significant_digits_are_those_asked_for(value, digits):
    shown = significant(value, digits).replace("−", "-")
    assert float(shown) == float(f"{value:.{digits}g}")


def test_very_small_and_large_numbers_take_an_exponent():
    assert [significant(v) for v in (2.5e-7, 1.5e8, 12345.0)] == ["2.5e−07", "1.5e+08", "12300"]


def test_colours_can_be_told_apart_by_name_in_both_schemes():
    for scheme in (0, 1):
        steps = [PALETTE[f"step-{i}"][scheme] for i in range(8)]
        assert len(set(steps)) == 8
    assert len(set(COLOUR.values())) == len(COLOUR)


def test_iterations_take_colours_in_order_however_many_there_are():
    assert sequence(8) == list(STEPS)
    numbers = [STEPS.index(colour) for colour in sequence(30)]
    assert numbers == sorted(numbers)
    assert len(sequence(0)) == 0
