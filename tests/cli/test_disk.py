"""A disk that fills up or cannot be written: clear errors, and nothing corrupted."""

import json
import subprocess
import time

import pytest

RECIPE = """kind: characterize
bench: bench.yaml
waveform: {trajectory: box}
motion: {periods: 8, samples_per_period: 128, period_rate: 4 Hz, return_to_start: false}
sensor: interferometer
"""


@pytest.fixture
def lab(labdrive):
    text = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
    (labdrive.folder / "bench.yaml").write_text(text.replace("x_per_volt", "speed: 1, x_per_volt"))
    (labdrive.folder / "recipe.yaml").write_text(RECIPE)
    return labdrive


@pytest.fixture
def disk(tmp_path):
    """Mount a small file system of its own, where the machine lets one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", folder]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("this machine does not let tests mount a file system")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def wait_for(ready, seconds=30):
    deadline = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def fill(disk):
    with (disk / "filling").open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass


def test_a_disk_that_fills_up_in_mid_recording_is_told_and_the_run_resumed(lab, disk):
    run = lab.start("run", "recipe.yaml", "--runs", disk)
    wait_for(lambda: list(disk.glob("*/recordings/*.spool")))
    time.sleep(0.3)
    fill(disk)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 1
    assert "0001.spool: No space left on device; free some space on the disk" in err
    assert "Traceback" not in err
    assert "Logging error" not in err
    (folder,) = disk.glob("2*")
    (disk / "filling").unlink()
    listed = lab("runs", "list", "--runs", disk).stdout
    assert "cut short" in listed or "failed" in listed
    done = lab("resume", folder, "--json")
    assert done.returncode == 0, done.stderr
    whole = lab("run", "recipe.yaml", "--runs", disk / "whole", "--json")
    found = [json.loads(ran.stdout)["periodic_error"]["rms"] for ran in (done, whole)]
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_a_disk_too_small_is_refused_before_anything_moves(lab, disk):
    long = ("--set", "motion.periods=400", "--set", "motion.samples_per_period=4096")
    done = lab("run", "recipe.yaml", "--runs", disk, *long)
    assert done.returncode == 1
    assert "the run needs up to" in done.stderr
    assert not list(disk.iterdir())


def test_a_folder_that_cannot_be_written_is_told(lab, disk):
    assert lab("run", "recipe.yaml", "--runs", disk).returncode == 0
    (folder,) = disk.glob("2*")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    for command in (("run", "recipe.yaml", "--runs", disk), ("report", folder)):
        done = lab(*command)
        assert done.returncode == 1, command
        assert "Read-only file system" in done.stderr
        assert "Traceback" not in done.stderr
    assert lab("runs", "list", "--runs", disk).returncode == 0
    assert lab("replay", folder).returncode == 0
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", [("schedule", "list"), ("serve", "--once")])
def test_a_job_store_that_is_none_is_told_and_left_alone(lab, command):
    store = lab.folder / "jobs.db"
    store.write_text("this is no job store, but somebody's notes")
    done = lab(*command, "--store", store)
    assert done.returncode == 1
    assert f"the job store {store}: file is not a database" in done.stderr
    assert store.read_text().startswith("this is no job store")
