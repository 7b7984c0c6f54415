"""The shipped recipes on the real recordings, against fits of our own."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

RECIPES = Path(__file__).parents[3] / "recipes"
ARCSEC = np.pi / 180 / 3600


def characterized(recipe, folder, *options):
    command = [sys.executable, "-m", "labdrive", "run", str(RECIPES / recipe), *options]
    command += ["--json", "--runs", str(folder)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)
    assert result["kind"] == "characterize"
    assert result["unit"] == "rad"
    return result


def amplitudes(phase, values, harmonics, drift_order):
    """Return amplitudes and residuals of an independent fit: a polynomial and harmonics."""
    line = 2 * phase / phase[-1] - 1
    rows = [line**power for power in range(drift_order + 1)]
    for k in range(1, harmonics + 1):
        rows += [np.cos(k * phase), np.sin(k * phase)]
    fit = np.linalg.lstsq(np.transpose(rows), values, rcond=None)[0]
    return np.hypot(*fit[drift_order + 1 :].reshape(-1, 2).T), values - fit @ rows


def guide_log(path):
    """Return time [s] and gear error [px] of a guide log, read line by line."""
    rows = [line.split(",") for line in path.read_text().splitlines() if '"Mount"' in line]
    time, raw, guide = (np.array([float(row[i]) for row in rows]) for i in (1, 5, 7))
    return time, raw + np.concatenate([[0], np.cumsum(guide)[:-1]])


def test_the_cogging_of_a_motor(recordings, tmp_path):
    result = characterized("characterize_odrive.yaml", tmp_path)
    time, counts, _ = np.loadtxt(
        recordings / "odrive" / "fast_uncompensated.csv", delimiter=",", skiprows=1, unpack=True
    )
    phase = 2 * np.pi * (time - time[0]) / 1.428571
    expected, _ = amplitudes(phase, counts * 2 * np.pi / 8192, 12, 1)
    found = np.array([harmonic["amplitude"] for harmonic in result["harmonics"]])
    np.testing.assert_allclose(found[[0, 3]], expected[[0, 3]], rtol=0.03)
    np.testing.assert_allclose(np.degrees(found[[0, 3]]), [1.3, 1.0], atol=0.1)
    assert result["step_size"] == pytest.approx(2 * np.pi / 7, rel=0.005)


def test_a_motor_recorded_with_jitter_turns_seven_electrical_cycles(
    recordings, actuator, sensor, played
):
    path = recordings / "odrive" / "fast_uncompensated.csv"
    motor = actuator(path, cycle="1.428571 s")
    phase, _, angle = played(
        motor, sensor(path, column="position_counts", scale="0.0439453125 deg")
    )
    assert motor.fixed_motion.periods == 7
    assert phase[-1] == pytest.approx(7 * 2 * np.pi, rel=1e-3)
    assert np.ptp(angle) == pytest.approx(2 * np.pi, rel=0.02)
    assert np.std(np.diff(phase)) > 0.05 * np.mean(np.diff(phase))


def test_the_worm_of_a_telescope(recordings, tmp_path):
    result = characterized("characterize_worm.yaml", tmp_path)
    time, pixels = guide_log(recordings / "phd2" / "phd2_perf03.txt")
    time -= time[0]

    def fit(period):
        return amplitudes(2 * np.pi * time / period, 3.82 * pixels, 8, 2)

    periods = np.arange(350, 420, 0.25)
    best = min(periods, key=lambda period: np.sum(fit(period)[1] ** 2))
    assert result["cycle"]["unit"] == "s"
    assert result["cycle"]["value"] == pytest.approx(best, abs=1)
    assert abs(result["cycle"]["value"] - 382.5) < 2 * result["cycle"]["standard_error"]
    found = np.array([h["amplitude"] for h in result["harmonics"]]) / ARCSEC
    assert found[0] == pytest.approx(fit(best)[0][0], rel=0.03)
    assert found[0] == pytest.approx(3.8, abs=0.1)


@pytest.mark.parametrize(("log", "rows"), [("01", 808), ("02", 952), ("03", 666), ("05", 3520)])
def test_every_guide_log_is_read_frame_by_frame(recordings, actuator, sensor, played, log, rows):
    path = recordings / "phd2" / f"phd2_perf{log}.txt"
    table = {"header": "Frame,", "only": {"column": "mount", "equals": "Mount"}}
    motor = actuator(path, column="Time", cycle="400 s", **table)
    gear_error = sensor(
        path, column="RARawDistance", add_running_sum="RAGuideDistance", scale="1 arcsec", **table
    )
    _, time, values = played(motor, gear_error)
    expected_time, expected = guide_log(path)
    np.testing.assert_array_equal(time, expected_time - expected_time[0])
    np.testing.assert_allclose(values, expected * ARCSEC, rtol=1e-12, atol=1e-18)
    assert len(time) > 0.99 * rows


@pytest.mark.parametrize(
    ("file", "phase", "cycle", "column"),
    [
        ("laas/laas_stopped_data.txt", "Time", "1 s", "Iq"),
        ("nmm/nmm_X_raw.csv", "Phase (deg)", "360 deg", "Radius"),
    ],
)
def test_tables_of_other_laboratories_are_read(
    recordings, actuator, sensor, played, file, phase, cycle, column
):
    scale = "1 deg" if "deg" in cycle else None
    motor = actuator(recordings / file, column=phase, cycle=cycle, scale=scale)
    phases, _, values = played(motor, sensor(recordings / file, column=column))
    lines = (recordings / file).read_text().splitlines()
    names = [name.strip() for name in lines[0].split(",")]
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:] if line])
    np.testing.assert_array_equal(values, rows[:, names.index(column)])
    assert len(phases) == len(rows)


def test_a_recording_that_is_not_there_points_to_the_page_that_tells_where_it_is(tmp_path):
    for name in ("characterize_odrive.yaml", "benches/odrive-recording.yaml", "data/README.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((RECIPES / name).read_bytes())
    command = [sys.executable, "-m", "labdrive", "check", "characterize_odrive.yaml"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "fast_uncompensated.csv; see data/README.md for where to get it" in ended.stderr
    assert "benches/odrive-recording.yaml:" in ended.stderr
