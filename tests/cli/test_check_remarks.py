"""What `labdrive check` says of a recipe that is good: conditions on trajectories, warnings."""

import numpy as np
import pytest

from labdrive.periodic.trajectories import TRAJECTORIES


@pytest.fixture
def check(labdrive):
    """Check the shipped optimize recipe with changes; return the lines after `disk`."""

    def run(*overrides, **bench_changes):
        bench = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
        for old, new in bench_changes.items():
            old_text = {"limits": "limits:\n", "sensor": "noise: 0.7 nm"}[old]
            assert old_text in bench
            bench = bench.replace(old_text, new)
        (labdrive.folder / "bench.yaml").write_text(bench)
        sets = [part for override in overrides for part in ("--set", override)]
        recipe = labdrive.recipes / "optimize.yaml"
        done = labdrive("check", recipe, "--bench", "bench.yaml", *sets)
        assert done.returncode == 0, done.stderr
        return done.stdout.partition("disk")[2].splitlines()[1:]

    run.folder = labdrive.folder
    return run


def test_conditions_that_do_not_hold_are_named(check):
    lines = check()
    assert len(lines) == 2
    assert lines[0].startswith("  ellipse         condition 3 does not hold")
    assert lines[1].startswith("  ellipse         condition 5 does not hold")
    assert check("waveform.trajectory=box") == [
        "  box             all five conditions on a trajectory hold"
    ]


def test_a_trajectory_of_ones_own_is_checked_alike(check):
    degrees = np.arange(0, 360, 1)
    x, y = TRAJECTORIES["box"](np.deg2rad(degrees))
    rows = [f"{d},{a:.9f},{b:.9f}" for d, a, b in zip(degrees, x, y, strict=True)]
    path = check.folder / "mine.csv"
    path.write_text("\n".join(["phase_deg,x,y", *rows]))
    assert check(f"waveform.trajectory={path}") == [
        "  mine.csv        all five conditions on a trajectory hold"
    ]


def test_harmonics_at_the_lowest_resonance_are_warned_about_with_a_remedy(check):
    slow = {"limits": "limits:\n  lowest_resonance: 100 Hz\n"}
    warnings = [line for line in check(**slow) if "warning" in line]
    assert len(warnings) == 1
    assert "up to 127, at 254 Hz" in warnings[0]
    assert "set optimizer.harmonics to 49 or fewer" in warnings[0]
    assert not [line for line in check("optimizer.harmonics=49", **slow) if "warning" in line]
    fast = ("waveform.trajectory=box", "motion.period_rate=20 Hz", "optimizer.harmonics=4")
    (warning,) = [line for line in check(*fast, **slow) if "warning" in line]
    assert "of the waveform is at 100 Hz" in warning
    assert "take a period_rate below 20 Hz" in warning


@pytest.mark.parametrize(("parts", "warned"), [(2, True), (2.5, False)])
def test_an_error_of_the_sensor_that_repeats_with_the_steps_is_warned_about(check, parts, warned):
    step = 4.8875e-6  # as the plan has it, by the linear model of the legs
    own = step / parts
    lines = check(sensor=f"periodic_error: 1 nm, period: {own * 1e9:.3f} nm")
    warnings = [line for line in lines if "warning" in line]
    assert bool(warnings) == warned
    if warned:
        assert "interferometer has an error of its own every" in warnings[0]
        assert "fit it 2 to 1 within one part in 32 cycles" in warnings[0]
