"""A number over many runs: control limits, shifts, drifts."""

import json

import numpy as np
import pytest

from labdrive.report.history import trend
from labdrive.report.trend import draw_trend


@pytest.fixture
def runs(tmp_path):
    """Return a function that writes run folders with a value each."""

    def write(values, kind="characterize", status="done", bench="/lab/a.yaml", first=0):
        for i, value in enumerate(values, start=first):
            folder = tmp_path / f"20260101T{i:06d}Z-{kind}-0000"
            folder.mkdir()
            info = {"status": status, "bench": bench, "recipe": "/lab/r.yaml", "started": str(i)}
            entry = {"periodic_error": {"rms": float(value)}}
            result = {"unit": "m", **({"verification": entry} if kind == "optimize" else entry)}
            (folder / "run.json").write_text(json.dumps(info))
            (folder / "result.json").write_text(json.dumps(result))
        return tmp_path

    return write


def noise(count, seed=0):
    return 50e-9 + 1e-9 * np.random.default_rng(seed).normal(size=count)


def alarms(root):
    found = trend(root, "periodic_error.rms", None, None)
    return [i for i, point in enumerate(found.points) if point.alarm]


def test_limits_are_three_standard_deviations_of_the_first_runs(runs):
    found = trend(runs(noise(200)), "periodic_error.rms", None, None)
    assert found.centre == pytest.approx(50e-9, abs=0.7e-9)
    assert found.high - found.centre == pytest.approx(3e-9, rel=0.4)
    assert found.unit == "m"


def test_chance_alarms_seldom_and_a_shift_at_once(runs):
    values = noise(60)
    values[50:] += 8e-9
    found = alarms(runs(values))
    assert set(range(50, 60)) <= set(found)
    assert len([i for i in found if i < 50]) <= 4


def test_a_drift_alarms_before_it_leaves_the_limits(runs):
    values = noise(60, seed=3)
    values[20:] += 0.08e-9 * np.arange(40)
    found = trend(runs(values), "periodic_error.rms", None, None)
    assert any("in a row above the centre" in point.alarm for point in found.points[25:])


def test_only_what_is_asked_for_counts(runs):
    runs(noise(6))
    runs([1.0], status="failed", first=10)
    runs([1.0], bench="/lab/other.yaml", first=20)
    root = runs(noise(2), kind="optimize", first=30)
    assert len(trend(root, "periodic_error.rms", "a.yaml", None).points) == 8
    assert trend(root, "periodic_error.rms", "other", None) is None
    assert trend(root, "no.such", None, None) is None


def test_the_chart_is_a_file(runs, tmp_path):
    found = trend(runs(noise(30)), "periodic_error.rms", None, None)
    for name, start in (("chart.svg", b"<?xml"), ("chart.pdf", b"%PDF")):
        draw_trend(found, tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(start)


def test_identical_results_are_no_alarm_for_the_rounding_of_one(runs):
    values = [50e-9] * 30
    values[25] = np.nextafter(50e-9, 1)
    assert alarms(runs(values)) == []


def test_results_that_differ_by_rounding_alone_are_not_eight_in_a_row(runs):
    values = [50e-9] * 20 + [np.nextafter(50e-9, 1)] * 20
    assert alarms(runs(values)) == []


@pytest.mark.parametrize(
    ("file", "text"), [("result.json", '{"periodic_er'), ("run.json", "\xff"), ("result.json", "")]
)
def test_a_damaged_run_is_left_out_and_named(runs, caplog, file, text):
    root = runs(noise(8))
    (root / "20260101T000003Z-characterize-0000" / file).write_text(text)
    found = trend(root, "periodic_error.rms", None, None)
    assert len(found.points) == 7
    assert "20260101T000003Z-characterize-0000 is left out of the history" in caplog.text
    assert file in caplog.text


def test_a_result_that_is_no_finite_number_is_left_out(runs):
    root = runs([*noise(8), float("nan"), float("inf")])
    assert len(trend(root, "periodic_error.rms", None, None).points) == 8
    assert alarms(root) == []
