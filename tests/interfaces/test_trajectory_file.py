"""Trajectories from CSV files."""

import numpy as np
import pytest

from labdrive.interfaces.trajectory_file import read_trajectory
from labdrive.model.errors import InputError
from labdrive.periodic.trajectories import TRAJECTORIES


def written(folder, lines):
    path = folder / "mine.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def sampled(name, count):
    degrees = np.arange(count) * 360 / count
    return degrees, *TRAJECTORIES[name](np.deg2rad(degrees))


def test_the_curve_goes_through_the_points_and_on_smoothly_round_the_turn(tmp_path):
    rows = [f"{p:.17g},{x:.17g},{y:.17g}" for p, x, y in zip(*sampled("ellipse", 24), strict=True)]
    curve = read_trajectory(written(tmp_path, ["phase_deg,x,y", *rows]))
    phase = np.linspace(-8, 8, 999)
    np.testing.assert_allclose(curve(phase), TRAJECTORIES["ellipse"](phase), atol=1e-4)
    degrees, x, y = sampled("ellipse", 24)
    np.testing.assert_allclose(curve(np.deg2rad(degrees) + 4 * np.pi), [x, y], atol=1e-12)


def test_columns_may_stand_in_any_order_among_others(tmp_path):
    rows = [f"{y}, a note, {x}, {p}" for p, x, y in zip(*sampled("triangle", 60), strict=True)]
    curve = read_trajectory(written(tmp_path, ["y, note, x, phase_deg", *rows]))
    np.testing.assert_allclose(curve(np.zeros(1))[1], 1, atol=1e-12)


GOOD = [f"{30 * i},{i},{i * i}" for i in range(12)]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["phase,x,y", *GOOD], r"mine\.csv:1: .*no 'phase_deg'"),
        (["phase_deg,x,y", *GOOD[:3], "90,abc,1"], r"mine\.csv:5: column 'x' .*got 'abc'"),
        (["phase_deg,x,y", *GOOD[:3], "90,1"], r"mine\.csv:5: column 'y' .*got ''"),
        (["phase_deg,x,y", *GOOD[:3], "45,1,1"], r"mine\.csv:5: .*must rise.*got 45"),
        (["phase_deg,x,y", *GOOD, "360,0,0"], r"mine\.csv:14: .*leave the last one out"),
        (["phase_deg,x,y", *GOOD[:5]], r"holds 5 points; at least 8"),
        ([], r"mine\.csv:1: .*must name the columns"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, lines, says):
    with pytest.raises(InputError, match=says):
        read_trajectory(written(tmp_path, lines))
