"""How jobs end in real processes: stopped by somebody, by an interlock, by a full disk, or busy."""

import json
import os
import signal
import sqlite3
import subprocess
import time
from contextlib import suppress

import pytest

from labdrive.store.lock import bench_lock, held, holder, is_held
from labdrive.store.run_folder import LOCK

from .lab import QUICK

YEARLY = ("--cron", "0 0 1 1 *")


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


def queue_one(lab, bench):
    """Put one job into the queue."""
    with sqlite3.connect(lab.folder / "state" / "queue.sqlite") as db:
        db.execute(
            "INSERT INTO jobs (schedule, due, bench, state) VALUES "
            "('quick', '2026-01-01T00:00:00+00:00', ?, 'queued')",
            (str(lab.folder / bench),),
        )


def fill(disk):
    with (disk / "filling").open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))


def end(service):
    service.send_signal(signal.SIGTERM)
    return service.communicate(timeout=60)[0]


def test_an_interrupted_run_that_cannot_be_gone_on_with_has_failed(lab):
    assert lab("schedule", "add", "quick.yaml", "--bench", "slow.yaml", *YEARLY).returncode == 0
    queue_one(lab, "slow.yaml")
    serve = lab.start("serve")
    lab.wait(lambda: list(lab.folder.glob("runs/*/journal.jsonl")))
    end(serve)
    (folder,) = lab.folder.glob("runs/*")
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"
    (folder / "recipe.yaml").write_text(QUICK.replace("box", "bax"))
    assert lab("serve", "--once").returncode == 1
    ((state, reason, _, attempts),) = lab.jobs()
    assert (state, attempts) == ("failed", 2)
    assert "did you mean box?" in reason


def test_a_run_that_somebody_stops_waits_and_of_a_paused_schedule_until_it_is_resumed(lab):
    assert lab("schedule", "add", "quick.yaml", "--bench", "slow.yaml", *YEARLY).returncode == 0
    queue_one(lab, "slow.yaml")
    serve = lab.start("serve")
    lab.wait(lambda: list(lab.folder.glob("runs/*/journal.jsonl")))
    assert lab("schedule", "pause", "quick").returncode == 0
    (folder,) = lab.folder.glob("runs/*")
    os.kill(holder(folder / LOCK), signal.SIGTERM)
    lab.wait(lambda: lab.jobs()[0][0] == "queued")
    ((_, reason, _, attempts),) = lab.jobs()
    assert attempts == 1
    assert "stopped by SIGTERM" in reason
    end(serve)
    assert lab("serve", "--once").returncode == 0
    assert lab.jobs()[0][3] == 1


def test_an_interlock_is_not_tried_again(lab):
    path = lab.folder / "slow.yaml"
    path.write_text(path.read_text() + "interlocks:\n  - {sensor: force, below: 0.4 N}\n")
    add = ("schedule", "add", "quick.yaml", "--bench", "slow.yaml", "--retries", "3", *YEARLY)
    assert lab(*add).returncode == 0
    queue_one(lab, "slow.yaml")
    assert lab("serve", "--once").returncode == 1
    ((state, reason, _, attempts),) = lab.jobs()
    assert (state, attempts) == ("failed", 1)
    assert reason.startswith("interlock: stopped: ")


def test_a_bench_in_use_leaves_no_log_of_each_try(lab, monkeypatch):
    monkeypatch.setenv("LABDRIVE_STATE", str(lab.folder / "state"))
    assert lab("schedule", "add", "quick.yaml", *YEARLY).returncode == 0
    queue_one(lab, "bench.yaml")
    with held(bench_lock(lab.folder / "bench.yaml"), "the bench"):
        assert lab("serve", "--once").returncode == 0
    ((state, reason, *_),) = lab.jobs()
    assert state == "queued"
    assert "is in use by process" in reason
    assert list(lab.folder.glob("state/jobs/*")) == []


def test_the_failure_of_a_run_that_speaks_of_use_is_no_bench_in_use(lab):
    """Drivers say of ports and files that they are in use, too."""
    (lab.folder / "quick.yaml").write_text(QUICK)
    assert lab("schedule", "add", "quick.yaml", *YEARLY).returncode == 0
    queue_one(lab, "bench.yaml")
    (lab.folder / "quick.yaml").write_text(QUICK.replace("box", "port is in use by another"))
    assert lab("serve", "--once").returncode == 1
    assert "is in use by another" in lab.jobs()[0][1]


def test_a_full_disk_neither_wedges_a_bench_nor_ends_the_service(lab, disk):
    (lab.folder / "state").symlink_to(disk)
    slow = (lab.folder / "slow.yaml").read_text().replace("speed: 0.05", "speed: 0.5")
    (lab.folder / "slow.yaml").write_text(slow)
    assert lab("schedule", "add", "quick.yaml", "--bench", "slow.yaml", *YEARLY).returncode == 0
    queue_one(lab, "slow.yaml")
    serve = lab.start("serve", "--runs", disk / "runs")
    try:
        lab.wait(lambda: list(disk.glob("runs/*/recordings/*.spool")))
        (folder,) = disk.glob("runs/*")
        fill(disk)
        lab.wait(lambda: not is_held(folder / LOCK))
        time.sleep(8)
        assert serve.poll() is None
        (disk / "filling").unlink()
        lab.wait(lambda: lab.jobs()[0][0] == "failed")
    finally:
        printed = end(serve)
    assert serve.returncode == 0
    assert "Logging error" not in printed
    assert "Traceback" not in printed
