import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.periodic.trajectories import TRAJECTORIES, box, triangle

TURN = 2 * np.pi
phases = st.floats(-30, 30).map(np.array)


@pytest.mark.parametrize("name", ["triangle", "box"])
def test_trajectories_are_the_printed_ones(name):
    power = {"triangle": 1, "box": 2}[name]
    x, y = TRAJECTORIES[name](np.array([0, 1.0, np.pi / 2, 2.5, 4.0]))
    scale = 3 * np.sqrt(6) / (4 * np.pi)
    back = np.array([2.5, 4.0]) - np.pi
    np.testing.assert_allclose(x[:3], scale * np.array([0, 1, np.pi / 2]), atol=1e-12)
    np.testing.assert_allclose(x[3:], scale * (4 / np.pi**2 * back**3 - 2 * back), atol=1e-12)
    lift = np.cos(np.array([0, 1.0, np.pi / 2, 2.5, 4.0 - TURN]) ** 2 / np.pi)
    np.testing.assert_allclose(y, 0.5 * (1 + lift) ** power, atol=1e-12)


@given(phases)
def test_the_ellipse_is_one(phase):
    x, y = TRAJECTORIES["ellipse"](phase)
    assert x**2 + y**2 == pytest.approx(1)
    assert (x, y) == pytest.approx((np.sin(phase), np.cos(phase)))


@given(phases)
def test_trajectories_repeat_and_are_smooth(phase):
    for trajectory in TRAJECTORIES.values():
        here, next_cycle = np.array(trajectory(phase)), np.array(trajectory(phase + TURN))
        np.testing.assert_allclose(next_cycle, here, atol=1e-12)
        before, after = (np.array(trajectory(phase + d)) for d in (-1e-6, 1e-6))
        np.testing.assert_allclose(before + after, 2 * here, atol=1e-9)


def test_lateral_stroke_is_one_either_way_and_lift_as_printed():
    phase = np.linspace(0, TURN, 100_001)
    for trajectory, peak in ((triangle, 1), (box, 2)):
        x, y = trajectory(phase)
        np.testing.assert_allclose([x.min(), x.max()], [-1, 1], atol=1e-8)
        np.testing.assert_allclose([y.min(), y.max()], [0, peak], atol=1e-8)


def test_group_a_carries_forwards_for_half_the_cycle():
    phase = np.linspace(-np.pi / 2, np.pi / 2, 1001)[1:-1]
    for trajectory in (triangle, box):
        x, y = trajectory(phase)
        assert np.all(y > trajectory(phase + np.pi)[1])
        np.testing.assert_allclose(np.diff(x), np.diff(x)[0])
        assert np.diff(x)[0] > 0
