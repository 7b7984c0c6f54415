"""What the walking drive does, seen through the bench or by its noise-free twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from labdrive.model.motion import Direction, Motion
from labdrive.model.waveform import TURN
from labdrive.periodic.phase_map import PhaseMap, node_phases
from labdrive.periodic.warp import warp
from labdrive_sim.walking_drive import WalkingDrive

FINE = 1 << 17
RATE_INDEPENDENT = {"amplifier_time": "0 s", "viscosity": "1e-6 N*s/m"}
SLOWLY = 1e-3


@st.composite
def phase_maps(draw):
    """Draw smooth maps that leave phase 0 alone and stretch the cycle by half at most."""
    orders = np.arange(1, 4)
    amplitudes = np.array([draw(st.floats(-1, 1)) for _ in orders])
    amplitudes *= 0.5 / max(1e-3, float(np.sum(np.abs(amplitudes * orders))))
    phases = np.array([draw(st.floats(0, TURN)) for _ in orders])
    angles = np.outer(orders, node_phases(FINE)) + phases[:, np.newaxis]
    bent = amplitudes @ (np.sin(angles) - np.sin(phases)[:, np.newaxis])
    return PhaseMap(node_phases(FINE) + bent)


def retimed(link, table, psi, motion):
    """Return how far [m] the drive on the warped table is from X_0 at psi."""
    phase, nominal = link.truth(table, motion)
    _, warped = link.truth(warp(table, psi, "shared_phase"), motion)
    more = np.append(nominal, nominal + nominal[-1] - nominal[0])
    return np.max(np.abs(warped - np.interp(psi(phase), np.append(phase, phase + phase[-1]), more)))


@given(phase_maps(), st.sampled_from(["ellipse", "triangle", "box"]), st.integers(0, 100))
@settings(max_examples=10, deadline=None)
def test_where_nothing_depends_on_rate_a_phase_map_only_retimes_the_path(
    walking, psi, trajectory, seed
):
    bench = walking(RATE_INDEPENDENT | {"seed": seed}, {"table_length": FINE})
    motion = Motion(2, 64, SLOWLY, 2)
    assert retimed(bench.link, bench.table(trajectory), psi, motion) < 0.05e-9


@pytest.mark.parametrize("slow", [{"amplifier_time": "1 ms"}, {"creep": 0.01}])
def test_amplifiers_and_creep_make_the_path_depend_on_its_timing(walking, motion, slow):
    bench = walking(RATE_INDEPENDENT | slow, {"table_length": FINE})
    phases = node_phases(FINE)
    psi = PhaseMap(phases + 0.4 * np.sin(phases))
    assert retimed(bench.link, bench.table(), psi, motion(period_rate_hz=5.0)) > 1e-9


def periodic_error(link, table, motion):
    """Return step size and, over one cycle, the periodic error, both in m."""
    phase, position = link.truth(table, motion)
    step = (position[-1] - position[0]) / motion.periods
    error = (position - step * phase / TURN)[:-1].reshape(motion.periods, -1).mean(axis=0)
    return step, error - error.mean()


def medians(walking, motion, trajectory):
    """Return medians of step, pv and rms [m] over twelve drives."""
    seen = []
    for seed in range(1, 13):
        bench = walking({"seed": seed})
        cycles = motion(period_rate_hz=1.0, settle_periods=4)
        step, error = periodic_error(bench.link, bench.table(trajectory), cycles)
        seen.append((step, np.ptp(error), np.std(error)))
    return np.median(seen, axis=0)


@pytest.mark.parametrize(
    ("trajectory", "step", "pv", "rms"),
    [
        ("ellipse", 4.45e-6, 704e-9, 227e-9),
        ("triangle", 5.33e-6, 301e-9, 84e-9),
        ("box", 3.77e-6, 180e-9, 44e-9),
    ],
)
def test_drives_of_the_kind_walk_as_the_papers_did(walking, motion, trajectory, step, pv, rms):
    found = medians(walking, motion, trajectory)
    assert found[0] == pytest.approx(step, rel=0.02)
    assert found[1] == pytest.approx(pv, rel=0.15)
    assert found[2] == pytest.approx(rms, rel=0.2)


@pytest.mark.parametrize("seed", range(1, 7))
def test_on_the_ellipse_the_rod_moves_back_at_the_hand_over(walking, motion, seed):
    bench = walking({"seed": seed})
    _, position = bench.link.truth(bench.table("ellipse"), motion(settle_periods=4))
    back = np.max(np.maximum.accumulate(position) - position)
    assert 10e-9 < back < 80e-9
    _, position = bench.link.truth(bench.table("box"), motion(settle_periods=4))
    assert np.all(np.diff(position) > -1e-11)


def stall_load(walking, motion, trajectory):
    """Return the load [N] at which a step comes to nothing."""
    loads = np.arange(30, 62, 4.0)
    steps = []
    for load in loads:
        bench = walking({"load": f"{load} N"})
        steps.append(periodic_error(bench.link, bench.table(trajectory), motion())[0])
    return np.interp(0, -np.array(steps), loads)


def test_the_triangle_stalls_first(walking, motion):
    triangle = stall_load(walking, motion, "triangle")
    assert triangle == pytest.approx(38, abs=4)
    assert stall_load(walking, motion, "ellipse") > triangle + 10
    assert stall_load(walking, motion, "box") > triangle + 10


def test_a_load_shortens_the_step_and_a_helping_one_lengthens_it(walking, motion):
    steps = [
        periodic_error(bench.link, bench.table(), motion())[0]
        for load in (-20, 0, 20)
        for bench in [walking({"load": f"{load} N"})]
    ]
    assert steps[0] > steps[1] > steps[2] > 0


def test_backward_it_walks_as_far_the_other_way(walking, motion):
    bench = walking()
    there, _ = periodic_error(bench.link, bench.table(), motion())
    back = motion(direction=Direction.BACKWARD)
    phase, position = bench.link.truth(bench.table(), back)
    assert phase[-1] == pytest.approx(-TURN * back.periods)
    assert (position[-1] - position[0]) / back.periods == pytest.approx(-there, rel=0.02)


def test_the_legs_pull_what_the_load_and_the_guide_take(walking, motion):
    force = {"plugin": "sim-force", "link": "plant", "noise": "0 N"}
    drive = {"load": "12 N", "guide_friction": "0.5 N", "viscosity": "1e-3 N*s/m"}
    bench = walking(drive, sensor=force)
    _, _, forward = bench.record(bench.table(), motion())
    assert forward == pytest.approx(12.5, abs=1e-6)
    _, _, backward = bench.record(bench.table(), motion(direction=Direction.BACKWARD))
    assert backward == pytest.approx(11.5, abs=1e-6)


def test_the_force_without_friction_is_the_load_and_drag(walking, motion):
    force = {"plugin": "sim-force", "link": "plant", "noise": "0 N"}
    drive = {"load": "3 N", "guide_friction": "0 N", "viscosity": "1000 N*s/m"}
    bench = walking(drive, {"table_length": 1024}, sensor=force)
    _, _, pulled = bench.record(bench.table(), motion(samples_per_period=1024))
    seen = walking(drive, {"table_length": 1024})
    _, time, position = seen.record(seen.table(), motion(samples_per_period=1024))
    assert pulled[1:] == pytest.approx(3 + 1000 * np.diff(position) / np.diff(time), abs=1e-5)


@pytest.mark.parametrize("width", [0.0, 0.05, 0.1, 0.2])
def test_a_tip_that_carries_the_rod_shows_the_hysteresis(walking, width):
    even = dict.fromkeys(("group_mismatch", "leg_mismatch", "element_mismatch", "play_spread"), 0)
    stiff = {"height_mismatch": "0 nm", "roughness": "0 nm", "guide_friction": "0 N"}
    bench = walking(RATE_INDEPENDENT | even | stiff | {"loop_width": width})
    up = np.arange(0, 48.01, 0.1)
    swing = np.concatenate([up, up[::-1], up, up[::-1]])
    # All legs go one way together, and the rod with them.
    voltages = np.stack([swing, 48 - swing, swing, 48 - swing], axis=1)
    bench.link.follow(voltages, np.arange(len(swing)) * 1.0, 1.0)
    position = bench.link.stretch.position
    rising, falling = position[-2 * len(up) : -len(up)], position[-len(up) :][::-1]
    stroke = 2 * 0.036e-6 * 48
    assert np.ptp(rising) == pytest.approx(stroke, rel=1e-6)
    assert np.max(falling - rising) == pytest.approx(width * stroke, rel=0.01, abs=1e-12)


def test_a_twin_is_the_drive_on_a_perfect_rod(walking, motion):
    perfect = {"roughness": "0 nm", "friction_spread": 0}
    bench = walking(perfect)
    phase, _, position = bench.record(bench.table(), motion())
    true_phase, true_position = walking({"roughness": "5 nm"}).link.truth(bench.table(), motion())
    stride = bench.table().length // motion().samples_per_period
    assert np.array_equal(phase, true_phase[::stride])
    assert np.array_equal(position, true_position[::stride])


def test_the_truth_leaves_the_drive_where_it_is(walking, motion):
    asked, left_alone = walking(), walking()
    asked.link.truth(asked.table(), motion())
    assert np.array_equal(
        asked.record(asked.table(), motion())[2],
        left_alone.record(left_alone.table(), motion())[2],
    )


def test_the_seed_draws_the_legs_and_nothing_else_does(walking, motion):
    def walked(plant_seed, run_seed):
        bench = walking({"seed": plant_seed}, seed=run_seed)
        return bench.record(bench.table(), motion())[2]

    assert np.array_equal(walked(1, 0), walked(1, 5))
    assert np.max(np.abs(walked(1, 0) - walked(2, 0))) > 1e-9


def test_position_goes_on_from_motion_to_motion(walking, motion):
    bench = walking()
    table = bench.table()
    first = bench.record(table, motion(settle_periods=0))[2]
    second = bench.record(table, motion(settle_periods=0), number=2)[2]
    step = (first[-1] - first[0]) / motion().periods
    assert abs(second[0] - first[-1]) < 0.01 * step
    assert second[-1] - second[0] == pytest.approx(first[-1] - first[0], rel=0.02)


def test_walked_there_and_back_it_is_near_where_it_was(walking, motion):
    bench = walking()
    there = motion(periods=8)
    out = bench.record(bench.table(), there)[2]
    chunks = list(bench.play(there.returning()))
    assert all(samples.settling for samples, _ in chunks)
    home = chunks[-1][1].value[-1]
    step = (out[-1] - out[0]) / there.periods
    assert abs(home - (out[0] - there.settle_periods * step)) < 0.2 * step


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"loop_width": 0.29, "play_max": "3 V"}, "raise play_max"),
        ({"play_max": "24 V"}, "play_min must be below play_max"),
        ({"preload": 180}, "needs a unit"),
        ({"viscosity": "0 N*s/m"}, "greater than 0"),
    ],
)
def test_settings_that_make_no_drive_are_refused(wrong, said):
    with pytest.raises(ValidationError, match=said):
        WalkingDrive.Settings.model_validate(wrong)
