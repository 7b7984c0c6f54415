"""`labdrive replay --set ...` of a run that sets loads: another load is an answer of its own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

RECIPES = Path(__file__).parents[2] / "recipes"
RECIPE = """kind: load_sweep
bench: bench.yaml
waveforms: [{trajectory: box}]
loads: [0 N, 10 N, 15 N, 20 N]
stall_within: 5 N
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz, settle_periods: 4}
sensor: interferometer
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Return a function that asks about a finished load sweep."""
    folder = tmp_path_factory.mktemp("loads")
    bench = RECIPES / "benches" / "lt40-sim-load.yaml"
    (folder / "bench.yaml").write_text(bench.read_text())
    (folder / "recipe.yaml").write_text(RECIPE)

    def labdrive(*arguments):
        command = [sys.executable, "-m", "labdrive", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)

    ran = labdrive("run", "recipe.yaml", "--json")
    assert ran.returncode == 0, ran.stderr
    run = json.loads(ran.stdout)["run"]
    return lambda *arguments: labdrive("replay", run, *arguments)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (
            "loads=[0 N, 12 N, 15 N, 20 N]",
            "before recording 2 a load of 12 N {}, where the run set 10 N",
        ),
        (
            "loads=[5 N, 10 N, 15 N, 20 N]",
            "before recording 1 a load of 5 N {}, where the run set 0 N",
        ),
        (
            "waveforms=[{trajectory: box}, {trajectory: ellipse}]",
            "before recording 5 a load of 0 N {}, where the run set no further one",
        ),
    ],
)
def test_another_load_is_told_in_plain_words(swept, changed, says):
    asked = swept("--set", changed)
    assert asked.returncode == 0, asked.stderr
    expected = says.format("would have been set") + "; the recordings answer up to there\n"
    assert asked.stdout == expected


def test_another_load_is_told_as_data(swept):
    found = json.loads(swept("--set", "loads=[5 N, 10 N, 15 N, 20 N]", "--json").stdout)
    assert found["departs_at"] == {"recording": 1, "label": ""}
    assert found["asks_for"] == ["load"]
    assert found["load"] == {"asked": 5.0, "was": 0.0}
    other = json.loads(swept("--set", "motion.periods=8", "--json").stdout)
    assert other["asks_for"] == ["motion"]
    assert other["load"] is None
