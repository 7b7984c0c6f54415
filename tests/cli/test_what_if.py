"""`labdrive replay RUN --set ...`: what other settings would have made of the recordings."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

RECIPES = Path(__file__).parents[2] / "recipes"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return a function that asks about a finished optimization."""
    folder = tmp_path_factory.mktemp("what-if")

    def labdrive(*arguments):
        command = [sys.executable, "-m", "labdrive", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)

    quick = ("--set", "motion.periods=4", "--set", "stop.max_iterations=2", "--json")
    ran = labdrive("run", RECIPES / "optimize_box.yaml", *quick)
    assert ran.returncode == 0, ran.stderr
    run = json.loads(ran.stdout)["run"]
    return lambda *arguments: labdrive("replay", run, *arguments)


def test_another_optimizers_proposal_is_compared_with_what_was_played(done):
    asked = done("--set", "optimizer.groups=symmetric", "--json")
    assert asked.returncode == 0, asked.stderr
    found = json.loads(asked.stdout)
    assert found["departs_at"] == {"recording": 2, "label": "iteration 1"}
    assert found["asks_for"] == ["table"]
    assert {one["channel"] for one in found["differences"]} == {"U0", "U1", "U2", "U3"}
    assert all(0.01 < one["rms"] < one["largest"] < 20 for one in found["differences"])
    told = done("--set", "optimizer.groups=symmetric")
    assert "iteration 0: periodic error" in told.stderr
    assert "recording 2 (iteration 1) would have been of another table;" in told.stdout
    assert "U0: off what was played by up to" in told.stdout


def test_settings_that_change_nothing_are_answered_to_the_end(done):
    asked = done("--set", "optimizer.least_slope=0.04")
    assert asked.returncode == 0
    assert "the recordings answer all of it" in asked.stdout


def test_another_motion_is_answered_by_no_recording(done):
    found = json.loads(done("--set", "motion.periods=8", "--json").stdout)
    assert found["departs_at"]["recording"] == 1
    assert found["asks_for"] == ["motion"]


def test_a_wrong_setting_is_told(done):
    wrong = done("--set", "optimizer.groups=nobody")
    assert wrong.returncode == 2
    assert "optimizer.groups" in wrong.stderr
    assert "Traceback" not in wrong.stderr
