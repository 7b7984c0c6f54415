"""Runs that are killed, and gone on with: as a user types it, with real processes."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from labdrive.model.errors import StoreError
from labdrive.store.journal import read_journal
from labdrive.store.spool import read_spool

RECIPE = """kind: optimize
bench: bench.yaml
waveform: {trajectory: box}
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz}
sensor: interferometer
optimizer: {use: fourier}
stop: {max_iterations: 3, least_gain: 0.001}
"""
ASIDE = {"run", "recordings"}
"""Keys of a result that tell where it is."""
LOADS = """kind: load_sweep
bench: bench.yaml
waveforms: [{trajectory: box}]
loads: [0 N, 10 N, 20 N, 60 N]
stall_within: 5 N
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz, settle_periods: 4}
sensor: interferometer
"""


@pytest.fixture
def lab(labdrive):
    """A folder with recipes, a fast bench, and one at real speed: slow enough to be killed."""
    bench = (labdrive.recipes / "benches" / "lt40-sim-load.yaml").read_text()
    bench = bench.replace("x_per_volt", "speed: SPEED, x_per_volt", 1)
    assert "SPEED" in bench
    (labdrive.folder / "slow.yaml").write_text(bench.replace("SPEED", "1"))
    (labdrive.folder / "bench.yaml").write_text(bench.replace("SPEED", "fast"))
    (labdrive.folder / "optimize.yaml").write_text(RECIPE)
    (labdrive.folder / "loads.yaml").write_text(LOADS)
    return labdrive


@pytest.fixture(scope="module")
def wholes():
    return {}


@pytest.fixture
def uninterrupted(lab, wholes):
    """Return the result of an uninterrupted run of a recipe, run once for all tests."""

    def whole(recipe):
        if recipe not in wholes:
            done = lab("run", recipe, "--json", "--runs", "whole")
            assert done.returncode == 0, done.stderr
            result = json.loads(done.stdout)
            wholes[recipe] = result | {"recordings": recordings(lab.folder / result["run"])}
        return dict(wholes[recipe])

    return whole


def only_run(lab, runs="killed"):
    (folder,) = (lab.folder / runs).iterdir()
    return folder


def killed_when(lab, recipe, ready, timeout=60):
    """Start a run, kill it as soon as `ready(journal entries)`; return its folder."""
    run = lab.start("run", recipe, "--bench", "slow.yaml", "--runs", "killed")
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline and run.poll() is None:
        journals = list((lab.folder / "killed").glob("*/journal.jsonl"))
        if journals and ready(read_journal(journals[0])):
            break
        time.sleep(0.005)
    assert run.poll() is None, run.stderr.read()
    run.send_signal(signal.SIGKILL)
    run.communicate()
    return only_run(lab)


def resumed(lab, folder):
    done = lab("resume", folder, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


def seen(event, number):
    return lambda entries: any(e["event"] == event and e["number"] == number for e in entries)


def compare(one, other, place=""):
    """Assert that two results agree: numbers to 1e-6, everything else exactly."""
    assert type(one) is type(other), place
    if isinstance(one, dict):
        one, other = ({k: v for k, v in d.items() if k not in ASIDE} for d in (one, other))
        assert one.keys() == other.keys(), place
        for key in one:
            compare(one[key], other[key], f"{place}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), place
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            compare(a, b, f"{place}[{i}]")
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-6), place
    else:
        assert one == other, place


def recordings(folder):
    return sorted(path.name for path in folder.glob("recordings/*.h5"))


@pytest.mark.parametrize(
    ("event", "number", "uncertain"),
    [
        ("recording_intended", 1, ["recording"]),
        ("recording_intended", 3, ["recording"]),
        ("recorded", 2, None),
        ("return_intended", 2, ["return"]),
        ("returned", 2, None),
    ],
)
def test_a_killed_run_resumes_to_the_result_of_an_uninterrupted_one(
    lab, uninterrupted, event, number, uncertain
):
    whole = uninterrupted("optimize.yaml")
    folder = killed_when(lab, "optimize.yaml", seen(event, number))
    before = read_journal(folder / "journal.jsonl")
    kept = {e["number"]: e["sha256"] for e in before if e["event"] == "recorded"}
    assert json.loads((folder / "run.json").read_text())["status"] == "running"
    result, told = resumed(lab, folder)
    compare(result, whole)
    after = read_journal(folder / "journal.jsonl")
    marked = [e["what"] for e in after if e["event"] == "uncertain"]
    assert uncertain is None or marked == uncertain
    assert f"resumed after {len(kept)} recordings" in told
    shas = {e["number"]: e["sha256"] for e in after if e["event"] == "recorded"}
    assert kept.items() <= shas.items()
    assert recordings(folder) == whole["recordings"]
    info = json.loads((folder / "run.json").read_text())
    assert info["status"] == "done"
    assert len(info["resumed"]) == 1
    replayed = lab("replay", folder)
    assert replayed.returncode == 0, replayed.stderr


def test_loads_are_put_back_before_going_on(lab, uninterrupted):
    whole = uninterrupted("loads.yaml")
    folder = killed_when(lab, "loads.yaml", seen("recording_intended", 3))
    result, _ = resumed(lab, folder)
    compare(result, whole)


def random_kills(lab, kills, seed):
    """Kill a run at random moments, resume it each time; return how often it was killed."""
    moments = np.random.default_rng(seed)
    command = ["run", "optimize.yaml", "--bench", "slow.yaml", "--runs", "killed"]
    happened = 0
    while True:
        process = subprocess.Popen(
            [sys.executable, "-m", "labdrive", *command],
            cwd=lab.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            _, error = process.communicate(
                timeout=moments.uniform(0.3, 1.6) if happened < kills else 120
            )
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            happened += 1
        else:
            assert process.returncode == 0, error
            return happened
        folders = list((lab.folder / "killed").glob("*/run.json"))
        if folders:
            command = ["resume", str(folders[0].parent)]


def check_random_kills(lab, uninterrupted, kills, seed):
    whole = uninterrupted("optimize.yaml")
    happened = random_kills(lab, kills, seed)
    folders = [path.parent for path in (lab.folder / "killed").glob("*/result.json")]
    assert len(folders) == 1
    compare(json.loads((folders[0] / "result.json").read_text()), whole)
    assert recordings(folders[0]) == whole["recordings"]
    return happened


def test_a_few_random_kills(lab, uninterrupted):
    assert check_random_kills(lab, uninterrupted, 5, seed=1) >= 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_a_hundred_random_kills_over_ten_runs(lab, uninterrupted, seed):
    check_random_kills(lab, uninterrupted, 10, seed)


def test_what_is_done_or_no_run_is_refused(lab):
    run = json.loads(lab("run", "optimize.yaml", "--json").stdout)["run"]
    done = lab("resume", run)
    assert done.returncode == 2
    assert "is done: there is nothing to go on with" in done.stderr
    assert "Traceback" not in done.stderr
    nowhere = lab("resume", "nowhere")
    assert nowhere.returncode == 2
    assert "is not a run folder" in nowhere.stderr


def test_one_run_at_a_time_on_a_bench_and_a_kill_frees_it(lab):
    bench = lab.folder / "slow.yaml"
    bench.write_text(bench.read_text().replace("speed: 1,", "speed: 0.1,"))
    run = lab.start("run", "optimize.yaml", "--bench", "slow.yaml", "--runs", "killed")
    while not list((lab.folder / "killed").glob("*/journal.jsonl")):
        time.sleep(0.01)
    folder = only_run(lab)
    second = lab("run", "optimize.yaml", "--bench", "slow.yaml", "--runs", "second")
    assert second.returncode == 1
    assert "is in use by process" in second.stderr
    assert not (lab.folder / "second").exists()
    again = lab("resume", folder)
    assert again.returncode == 1
    assert f"process {run.pid}" in again.stderr
    run.kill()
    run.communicate()
    # What is resumed goes at the bench's speed, so it is enough that it begins.
    resumed_run = lab.start("resume", folder)
    while "resumed after" not in resumed_run.stderr.readline():
        assert resumed_run.poll() is None
    resumed_run.kill()
    resumed_run.communicate()


@pytest.mark.parametrize("damage", ["flip", "truncate", "gone"])
def test_a_damaged_recording_is_named_and_nothing_moves(lab, damage):
    folder = killed_when(lab, "optimize.yaml", seen("recording_intended", 2))
    path = folder / "recordings" / "0001.h5"
    data = bytearray(path.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 1
    path.write_bytes(data if damage == "flip" else data[:-100])
    if damage == "gone":
        path.unlink()
    done = lab("resume", folder)
    assert done.returncode == 1
    assert "recordings/0001.h5" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(folder.glob("recordings/0002.h5"))


def test_other_recipes_in_the_folder_are_noticed(lab):
    folder = killed_when(lab, "optimize.yaml", seen("recording_intended", 2))
    recipe = folder / "recipe.yaml"
    recipe.write_text(recipe.read_text().replace("trajectory: box", "trajectory: triangle"))
    done = lab("resume", folder)
    assert done.returncode == 1
    assert "recording 1 (iteration 0) differs" in done.stderr


def test_changed_versions_are_said(lab):
    folder = killed_when(lab, "optimize.yaml", seen("recording_intended", 2))
    info = json.loads((folder / "run.json").read_text())
    info["versions"]["labdrive"] = "0.0.7"
    (folder / "run.json").write_text(json.dumps(info))
    _, told = resumed(lab, folder)
    assert "since the run began: labdrive was 0.0.7" in told
    started = [e for e in read_journal(folder / "journal.jsonl") if e["event"] == "run_started"]
    assert len(started) == 2
    assert started[1]["versions"]["labdrive"] != "0.0.7"


def test_of_what_was_read_before_a_kill_at_most_a_second_is_lost(lab):
    slow = (lab.folder / "slow.yaml").read_text().replace("speed: 1,", "speed: 0.1,")
    (lab.folder / "slow.yaml").write_text(slow)

    def under_way(_):
        spools = list((lab.folder / "killed").glob("*/recordings/0001.spool"))
        return bool(spools) and len(read_rows(spools[0])) > 0

    folder = killed_when(lab, "optimize.yaml", under_way)
    killed_at = time.time()
    (spool,) = folder.glob("recordings/*.spool")
    columns = read_spool(spool)
    assert set(columns) == {"phase", "time", "interferometer", "force"}
    # The recorded phases go at 20 Hz, a tenth of real speed: 128 samples a second of the wall's.
    assert killed_at - spool.stat().st_mtime < 1
    count = len(columns["phase"])
    np.testing.assert_allclose(columns["phase"], 2 * np.pi * np.arange(count) / 64)
    resumed(lab, folder)
    (left,) = folder.glob("recordings/*.spool")
    assert left.name == "0001.part-1.spool"
    marks = [e for e in read_journal(folder / "journal.jsonl") if e["event"] == "uncertain"]
    assert marks[0]["file"] == "recordings/0001.part-1.spool"


def read_rows(path):
    try:
        return read_spool(path)["time"]
    except StoreError:  # its first line is not written yet
        return []
