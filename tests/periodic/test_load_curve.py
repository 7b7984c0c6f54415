"""Load curves: compliance, onset of slip and stall load from points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import EstimationError
from labdrive.periodic.load_curve import load_curve

STEP_M = 5e-6


def curve_of(load, onset, compliance=2e-8, softening=1e-7):
    """A step that falls on a line, and steeper beyond `onset`, down to nothing."""
    line = STEP_M - compliance * load
    return np.maximum(line - softening * np.maximum(load - onset, 0), 0.0)


def measured(load, step, noise=0.0):
    return load_curve(load, step, np.full(len(load), noise))


@given(
    compliance=st.floats(1e-9, 5e-8),
    onset=st.floats(12, 30),
    spacing=st.floats(1, 3),
    softening=st.floats(1e-7, 3e-7),
)
def test_a_line_that_breaks_is_told_by_its_slope_its_break_and_its_end(
    compliance, onset, spacing, softening
):
    load = np.arange(0, 70, spacing)
    step = curve_of(load, onset, compliance, softening)
    found = measured(load, step)
    # Up to 1 % of the step passes for a line, which bends the line that much.
    allowed = 0.02 * STEP_M / (load[found.linear - 1] - load[0])
    assert found.compliance.value == pytest.approx(compliance, abs=allowed)
    late = 0.03 * STEP_M / softening + spacing
    assert onset - spacing <= found.slip_onset.value <= onset + late
    if found.stall_load is not None:
        true_stall = (0.98 * STEP_M + softening * onset) / (compliance + softening)
        assert abs(found.stall_load.value - true_stall) <= spacing
        assert found.stall_load.standard_error == pytest.approx(spacing / np.sqrt(12))


def test_errors_of_the_line_are_those_seen_over_many_curves():
    random, load, noise = np.random.default_rng(1), np.arange(0, 40, 4.0), 2e-9
    line = STEP_M - 2e-8 * load
    found = [measured(load, line + noise * random.normal(size=10), noise) for _ in range(400)]
    scatter = np.std([curve.compliance.value for curve in found])
    told = np.median([curve.compliance.standard_error for curve in found])
    assert told == pytest.approx(scatter, rel=0.25)


def test_a_curve_that_never_slips_or_stalls_says_neither():
    load = np.arange(0, 20, 4.0)
    found = measured(load, STEP_M - 1e-8 * load)
    assert found.slip_onset is None
    assert found.stall_load is None
    assert found.linear == len(load)


def test_too_few_points_are_refused():
    with pytest.raises(EstimationError, match="3 loads are too few"):
        measured(np.arange(3.0), np.ones(3))
