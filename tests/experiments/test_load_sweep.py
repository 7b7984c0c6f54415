"""Load sweeps, scaling sweeps and rolling resistance on the simulated drive."""

import json

import numpy as np
import pytest

QUICK = ("motion.periods=4", "motion.samples_per_period=64")
COARSE = ("loads=[0 N, 10 N, 20 N, 30 N, 40 N, 50 N, 60 N]", "stall_within=2 N")


def curves(done):
    return {curve["waveform"]: curve for curve in done.result["curves"]}


def test_the_triangle_steps_furthest_and_stalls_first(ran):
    done = ran("load_sweep.yaml", *QUICK, *COARSE)
    found = curves(done)
    steps = {name: curve["step_size"] for name, curve in found.items()}
    stalls = {name: curve["stall_load"] for name, curve in found.items()}
    assert max(steps, key=steps.get) == "triangle"
    assert min(stalls, key=stalls.get) == "triangle"
    assert stalls["triangle"] < 0.75 * min(stalls["ellipse"], stalls["box"])


def test_points_are_the_contracts_and_end_where_the_drive_stalls(ran):
    done = ran("load_sweep.yaml", *QUICK, *COARSE, "waveforms=[{trajectory: box}]")
    points = done.result["points"]
    keys = {"waveform", "load", "x_scale", "y_scale", "step_size", "standard_error", "slipping"}
    assert all(keys <= set(point) for point in points)
    asked = [point["load_set"] for point in points]
    assert asked == sorted(asked)
    (curve,) = done.result["curves"]
    assert points[-1]["step_size"] < 0.02 * points[0]["step_size"]
    borne = [p["load_set"] for p in points if p["step_size"] > 0.02 * points[0]["step_size"]]
    assert 0 < asked[asked.index(borne[-1]) + 1] - borne[-1] <= 2
    assert not points[0]["slipping"]
    assert points[-1]["slipping"]
    assert curve["slip_onset"] < curve["stall_load"]


def test_loads_are_read_by_the_force_sensor_less_the_rolling_resistance(ran, tmp_path):
    rolling = ran("rolling_resistance.yaml", *QUICK)
    # The guide of the simulated drive takes 0.5 N; the viscosity of its oil next to nothing.
    assert rolling.result["rolling_resistance"] == pytest.approx(0.5, rel=0.01)
    path = tmp_path / "rolling.json"
    path.write_text(json.dumps(rolling.result))
    one = (*QUICK, "waveforms=[{trajectory: box}]", "loads=[0 N, 5 N, 10 N, 20 N]")
    less = ran("load_sweep.yaml", *one, f"rolling_resistance_from={path}")
    loads = [point["load"] for point in less.result["points"]]
    np.testing.assert_allclose(loads, [0, 5, 10, 20], atol=0.05)
    as_read = ran("load_sweep.yaml", *one)
    assert as_read.result["points"][0]["load"] == pytest.approx(0.5, rel=0.01)


def test_scaling_x_keeps_the_stall_load_and_scaling_y_does_not(ran):
    done = ran("scaling_sweep.yaml", *QUICK, *COARSE, "scales=[0.8, 0.6]")
    trends = done.result["trends"]
    assert trends["x"]["r_squared"] > 0.995
    assert trends["x"]["intercept"] < 0  # affine, and not in proportion
    assert min(trends["x"]["stall_shares"]) > 0.88
    assert trends["y"]["stall_shares"][2] < 0.7
    assert trends["both"]["stall_shares"][2] < 0.65
    np.testing.assert_allclose(
        [curve["pretension_change"] for curve in done.result["curves"]], 0, atol=1e-12
    )


def test_scaling_about_the_same_middle_says_how_the_pretension_changes(ran):
    free = ("waveform.pretension=free", "waveform.amplitude=max", "axes=[y]", "scales=[0.6]")
    done = ran("scaling_sweep.yaml", *QUICK, *COARSE, *free)
    changes = [curve["pretension_change"] for curve in done.result["curves"]]
    assert changes[0] == 0
    assert changes[1] < -10e-9
