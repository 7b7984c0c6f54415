"""The paper's findings on twelve simulated plants, with the numbers that docs/paper.md gives."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "findings.py"

pytestmark = pytest.mark.slow


def found(name):
    command = [sys.executable, str(SCRIPT), name, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=1200)
    assert done.returncode == 0, done.stderr
    return {key: np.array(values) for key, values in json.loads(done.stdout)[name].items()}


def test_legs():
    legs = found("legs")
    assert np.median(legs["R2"]) >= 0.98
    assert legs["loop"].min() >= 0.08
    assert legs["loop"].max() <= 0.11
    assert np.median(legs["loop wide"]) == pytest.approx(0.125, abs=0.003)
    assert np.median(legs["R2 wide"]) < 0.98


def test_the_papers_setting():
    paper = found("paper")
    assert np.median(paper["ellipse pv times"]) >= 6
    assert np.median(paper["ellipse rms times"]) >= 12
    assert np.median(paper["ellipse rms times, true"]) >= 12
    assert paper["box starts at, of ellipse"].max() <= 0.35
    assert np.sum(paper["box led by k"] == 1) >= 11


def test_a_shared_phase():
    shared = found("shared")
    assert np.median(shared["ellipse times"]) >= 50
    for name in ("triangle", "box"):
        assert shared[f"{name} after, nm"].max() <= 1.5


def test_groups_of_their_own_go_below_any_shared_phase():
    assert found("per_group")["ellipse after, nm"].max() < 0.5


def test_loads():
    loads = found("loads")
    steps = np.array([loads[f"{name} step, um"] for name in ("ellipse", "triangle", "box")])
    stalls = np.array([loads[f"{name} stall, N"] for name in ("ellipse", "triangle", "box")])
    assert np.sum(steps.argmax(axis=0) == 1) >= 11
    assert np.sum(stalls.argmin(axis=0) == 1) >= 11


def test_scaling():
    scaling = found("scaling")
    assert scaling["x: R2 of a line"].min() >= 0.995
    for scale in (0.8, 0.6, 0.4):
        assert np.abs(scaling[f"x at {scale}: stall"] - 1).max() <= 0.12
    assert scaling["y at 0.6: stall"].max() <= 0.7
    assert scaling["both at 0.6: stall"].max() <= 0.65


def test_both_directions():
    reverse = found("reverse")
    cases = ("optimized_forward", "swapped_backward", "optimized_backward")
    rising = np.array([reverse[name] for name in (*cases, "unoptimized_backward")])
    assert np.sum(np.all(np.diff(rising, axis=0) > 0, axis=0)) >= 11
    assert np.abs(reverse["alike: swapped / forward"] - 1).max() <= 0.1
    assert np.median(reverse["stiff: optimized_backward / forward"]) == pytest.approx(1, abs=0.2)
