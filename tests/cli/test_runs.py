"""`labdrive runs` over folders that were written by hand: damaged ones, old ones, too many."""

import json

import pytest


@pytest.fixture
def runs(labdrive):
    """Return a function that writes a run folder of 100 kB."""

    def write(number, status="done", result=None):
        folder = labdrive.folder / "runs" / f"20260101T{number:06d}Z-characterize-0000"
        folder.mkdir(parents=True)
        info = {"status": status, "recipe": "r.yaml", "bench": "b.yaml", "started": str(number)}
        (folder / "run.json").write_text(json.dumps(info))
        value = {"unit": "m", "periodic_error": {"rms": 1e-9 + 1e-12 * number}}
        (folder / "result.json").write_text(json.dumps(value) if result is None else result)
        (folder / "data").write_bytes(bytes(100_000))
        return folder

    return write


def test_a_trend_does_without_damaged_runs_and_names_them(labdrive, runs):
    for number in range(6):
        runs(number)
    damaged = runs(6, result='{"periodic_')
    told = labdrive("runs", "trend")
    assert told.returncode == 0
    assert len(told.stdout.splitlines()) == 7
    assert f"{damaged.name} is left out of the history" in told.stderr
    assert "Traceback" not in told.stderr


def test_prune_says_what_is_left_and_why_if_that_is_too_much(labdrive, runs):
    first, last, cut = runs(0), runs(1), runs(2, status="running")
    runs(3, status="failed")
    told = labdrive("runs", "prune", "--budget", "0.15").stdout.splitlines()
    assert told == [
        f"{first.name}  0.1 MB  gone",
        f"{'20260101T000003Z-characterize-0000'}  0.1 MB  gone",
        "left: 2 runs, 0.2 MB, more than asked for, as these stay:",
        f"{cut.name}  0.1 MB  cut short: labdrive resume can go on with it",
        f"{last.name}  0.1 MB  the last good run of its recipe on its bench",
    ]
    assert "left:" not in labdrive("runs", "prune", "--keep", "2").stdout


@pytest.mark.parametrize(
    "wrong", [("--budget", "nan"), ("--budget", "inf"), ("--budget", "-1"), ("--keep", "few")]
)
def test_what_is_to_be_left_must_be_a_number(labdrive, wrong):
    told = labdrive("runs", "prune", *wrong)
    assert told.returncode == 2
    assert f"{wrong[1]} is no " in told.stderr
    assert "Traceback" not in told.stderr
