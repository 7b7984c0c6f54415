"""What the shipped recipes show, judged independently: by least squares on the raw recordings,
by the simulator's dense truth, which no optimizer sees, and by the real recordings' own numbers.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from labdrive.engine.discovery import discover
from labdrive.engine.plan import prepare
from labdrive.engine.run import run
from labdrive.model.errors import InputError
from labdrive.recipe.load import load

RECIPES = Path(__file__).parents[2] / "recipes"


def fitted(phase, reading, orders):
    """Return complex amplitudes of harmonics by a plain least-squares fit with a line."""
    columns = [np.ones_like(phase), phase]
    columns += [wave(k * phase) for k in orders for wave in (np.cos, np.sin)]
    scale = np.array([np.abs(column).max() for column in columns])
    solution = np.linalg.lstsq(np.stack(columns, axis=1) / scale, reading, rcond=None)[0] / scale
    return solution[2::2] - 1j * solution[3::2]


def rms(harmonics):
    return np.sqrt(np.sum(np.abs(harmonics) ** 2) / 2)


def test_ellipse_improves_at_least_ten_times_judged_from_the_raw_recordings(ran):
    done = ran("optimize.yaml")
    before, after = done.result["iterations"][0], done.result["verification"]
    independent = [
        rms(fitted(*done.raw(entry), range(1, len(entry["harmonics"]) + 1)))
        for entry in (before, after)
    ]
    assert independent[0] / independent[1] >= 10
    reported = [entry["periodic_error"]["rms"] for entry in (before, after)]
    assert reported == pytest.approx(independent, rel=0.05)
    assert done.result["improvement"] == pytest.approx(reported[0] / reported[1])


def test_reported_harmonics_are_those_of_an_independent_fit(ran):
    entry = ran("optimize.yaml").result["iterations"][0]
    done = ran("optimize.yaml")
    found = fitted(*done.raw(entry), range(1, 128))[:8]
    told = [h["amplitude"] * np.exp(1j * h["phase"]) for h in entry["harmonics"][:8]]
    np.testing.assert_allclose(told, found, atol=0.05e-9)


@pytest.mark.parametrize("trajectory", ["triangle", "box"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_true_error_comes_to_the_noise_floor_in_two_updates(ran, trajectory, seed):
    done = ran(
        "optimize.yaml",
        f"waveform.trajectory={trajectory}",
        "motion.periods=16",
        "stop.max_iterations=2",
        f"seed={seed}",
    )
    floor = done.result["iterations"][0]["noise_floor"]["rms"]
    # White noise of 0.7 nm gives sigma sqrt((m - 2) / (n m)); the rough rod adds a little.
    assert 1.0 < floor / (0.7e-9 * np.sqrt(254 / (16 * 256))) < 1.3
    last = done.result["iterations"][-1]["iteration"]
    assert last <= 2
    assert done.truth_rms(0) > 100 * floor
    assert done.truth_rms(last) < 1.5 * floor


def test_the_shared_table_leaves_odd_harmonics_and_symmetric_does_not_build_them_up(ran):
    quick = ("waveform.trajectory=box", "stop.max_iterations=2")
    best = {}
    for groups in ("shared_phase", "symmetric", "shared_table"):
        entry = ran("optimize.yaml", *quick, f"optimizer.groups={groups}").result["verification"]
        best[groups] = entry["periodic_error"]["rms"]
        amplitudes = [h["amplitude"] for h in entry["harmonics"]]
        if groups != "shared_phase":
            assert int(np.argmax(amplitudes)) % 2 == 0  # k = 1, 3, 5, ... lead
    assert best["shared_phase"] < 0.1 * best["symmetric"]


def test_an_ellipse_that_runs_backwards_is_refused_unless_limited(ran, tmp_path):
    with pytest.raises(AssertionError):
        ran("optimize.yaml", "optimizer.on_nonmonotonic=error")
    (folder,) = (tmp_path / "runs").iterdir()
    info = json.loads((folder / "run.json").read_text())
    assert info["status"] == "failed"
    assert "backwards" in info["reason"]
    assert "on_nonmonotonic: limit" in info["reason"]


def test_spindle_comes_to_the_noise_floor(ran):
    done = ran("optimize_spindle.yaml")
    before, after = done.result["iterations"][0], done.result["verification"]
    assert before["periodic_error"]["rms"] > 1e-6
    assert after["periodic_error"]["rms"] < 2 * after["noise_floor"]["rms"]


def test_characterize_changes_nothing_and_agrees_with_optimize(ran):
    single = ran("characterize.yaml", "waveform.trajectory=box").result
    first = ran("optimize.yaml", "waveform.trajectory=box").result["iterations"][0]
    assert single["periodic_error"] == first["periodic_error"]
    assert single["step_size"] == first["step_size"]


def test_a_polled_jittered_sensor_gives_the_same_error_by_least_squares(ran, tmp_path):
    bench = (RECIPES / "benches" / "lt40-sim.yaml").read_text()
    bench = bench.replace("  force: {plugin: sim-force, link: plant}\n", "")
    bench = bench.replace("link: plant, noise", "sampling: polled, link: plant, noise")
    (tmp_path / "polled.yaml").write_text(bench)
    host = discover()
    overrides = ("estimator=least_squares", "harmonics=40")
    loaded = load(RECIPES / "characterize.yaml", host.plugins, tmp_path / "polled.yaml", overrides)
    prepared = prepare(loaded, host.plugins)
    polled = run(prepared, host, tmp_path / "runs", lambda _: None).result
    triggered = ran("characterize.yaml").result
    for ours, theirs in zip(polled["harmonics"][:8], triggered["harmonics"][:8], strict=True):
        tolerance = 4 * (ours["standard_error"] + theirs["standard_error"])
        assert ours["amplitude"] == pytest.approx(theirs["amplitude"], abs=tolerance)


def test_an_estimator_that_the_samples_do_not_suit_is_refused_before_anything_runs(ran, tmp_path):
    with pytest.raises(InputError, match=r"estimator: .*; use least_squares \(got exact\)"):
        ran("characterize_odrive.yaml", "estimator=exact")
    assert not (tmp_path / "runs").exists()


def test_odrive_harmonics_1_and_4_are_those_of_an_independent_fit(ran):
    done = ran("characterize_odrive.yaml")
    table = np.genfromtxt(
        RECIPES / "data" / "odrive" / "fast_uncompensated.csv", delimiter=",", names=True
    )
    phase = 2 * np.pi * (table["time_s"] - table["time_s"][0]) / 1.428571
    position = table["position_counts"] * 2 * np.pi / 8192
    found = np.abs(fitted(phase, position, range(1, 13)))
    told = [h["amplitude"] for h in done.result["harmonics"]]
    assert done.result["unit"] == "rad"
    for k in (1, 4):
        assert told[k - 1] == pytest.approx(found[k - 1], rel=0.03)
    assert np.degrees(told[0]) == pytest.approx(1.3, abs=0.1)
    assert np.degrees(told[3]) == pytest.approx(1.0, abs=0.1)


def test_worm_period_and_fundamental(ran):
    result = ran("characterize_worm.yaml").result
    assert result["cycle"]["value"] == pytest.approx(382.5, abs=1.0)
    assert result["cycle"]["unit"] == "s"
    arcsec = np.degrees(result["harmonics"][0]["amplitude"]) * 3600
    assert arcsec == pytest.approx(3.8, abs=0.3)


def test_groups_with_a_timing_of_their_own_take_the_ellipse_to_the_noise_floor(ran):
    shared = ran("optimize.yaml").result["verification"]
    done = ran("optimize_per_group.yaml")
    after = done.result["verification"]
    assert done.result["improvement"] > 500
    assert after["periodic_error"]["rms"] < 0.2 * shared["periodic_error"]["rms"]
    assert after["periodic_error"]["rms"] < 2.5 * after["noise_floor"]["rms"]
    assert done.truth_rms(done.result["best_iteration"]) < 0.5e-9
    assert "re-timed by" in done.result["iterations"][-1]["remark"]


@pytest.mark.parametrize("trajectory", ["triangle", "box"])
def test_groups_of_their_own_harm_no_waveform_that_needs_them_less(ran, trajectory):
    done = ran("optimize_per_group.yaml", f"waveform.trajectory={trajectory}")
    assert done.truth_rms(done.result["best_iteration"]) < 0.5e-9
