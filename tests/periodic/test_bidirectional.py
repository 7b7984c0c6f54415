"""Parameters of ISO 230-2, against an example worked by hand and what they must not depend on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.periodic.bidirectional import positioning, targets

# Two runs over two targets. Forward means 1 and 5, backward -1 and 2; s is 1.4142 at the first
# target forward (0 and 2), 0 elsewhere.
FORWARD = np.array([[0.0, 5.0], [2.0, 5.0]])
BACKWARD = np.array([[-1.0, 2.0], [-1.0, 2.0]])
S = np.sqrt(2)


def test_the_example_worked_by_hand():
    found = positioning(targets(FORWARD, BACKWARD))
    assert found.as_dict() == pytest.approx(
        {
            "mean_reversal_value": 2.5,  # (2 + 3) / 2
            "reversal_value": 3.0,
            "repeatability_forward": 4 * S,
            "repeatability_backward": 0.0,
            # First target: the largest of 2 s + |B| = 4.83 and 4 s = 5.66. Second: |B| = 3.
            "repeatability": 4 * S,
            "systematic_deviation_forward": 4.0,
            "systematic_deviation_backward": 3.0,
            "systematic_deviation": 6.0,  # from -1 to 5
            "mean_bidirectional_deviation": 3.5,  # from 0 to 3.5
            "accuracy_forward": 5.0 - (1 - 2 * S),  # 5 is above 1 + 2 s = 3.83
            "accuracy_backward": 3.0,
            "accuracy": 5.0 - (1 - 2 * S),
        }
    )


deviations = arrays(float, (3, 5), elements=st.floats(-1e3, 1e3))


@given(deviations, deviations, st.floats(-1e3, 1e3))
def test_where_the_scale_begins_does_not_matter(forward, backward, origin):
    here = positioning(targets(forward, backward)).as_dict()
    there = positioning(targets(forward + origin, backward + origin)).as_dict()
    assert there == pytest.approx(here, abs=1e-9)


@given(deviations, deviations)
def test_turned_round_the_reversal_changes_its_sign_and_nothing_else(forward, backward):
    one, other = (
        positioning(targets(*pair)) for pair in ((forward, backward), (backward, forward))
    )
    assert other.mean_reversal_value == pytest.approx(-one.mean_reversal_value, abs=1e-9)
    assert other.accuracy == pytest.approx(one.accuracy)
    assert other.repeatability == pytest.approx(one.repeatability)
    assert other.repeatability_forward == one.repeatability_backward
