"""The power goes while a run is under way: an ext4 of our own is shut down without its log.

Needs root, Linux, mkfs.ext4 and loop devices; where the machine does not let us, it is skipped.
"""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from labdrive.store.journal import read_journal
from labdrive.store.recordings import file_sha256

fcntl = pytest.importorskip("fcntl", reason="Windows has no ext4")

RECIPES = Path(__file__).parents[2] / "recipes"
EXT4_IOC_SHUTDOWN = 0x8004587D
NO_LOG_FLUSH = 2
RECIPE = """kind: optimize
bench: bench.yaml
waveform: {trajectory: box}
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz}
sensor: interferometer
optimizer: {use: fourier}
stop: {max_iterations: 3, least_gain: 0.001}
"""


class Disk:
    """An ext4 in a file, mounted on a folder."""

    def __init__(self, folder):
        self.image, self.mount = folder / "disk.img", folder / "mnt"
        self.mount.mkdir()
        self.image.write_bytes(b"")
        os.truncate(self.image, 64 << 20)
        self._do("mkfs.ext4", "-q", "-F", self.image)
        self.attach()

    def attach(self):
        self._do("mount", "-o", "loop", self.image, self.mount)

    def detach(self):
        self._do("umount", self.mount)

    def cut(self):
        """Let everything that is not on the disk be lost, here and now."""
        handle = os.open(self.mount, os.O_RDONLY)
        try:
            fcntl.ioctl(handle, EXT4_IOC_SHUTDOWN, struct.pack("I", NO_LOG_FLUSH))
        finally:
            os.close(handle)

    @staticmethod
    def _do(*command):
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
        if done.returncode:
            raise OSError(done.stderr)


@pytest.fixture
def disk(tmp_path):
    if os.geteuid() != 0 or not shutil.which("mkfs.ext4"):
        pytest.skip("needs root and mkfs.ext4")
    try:
        disk = Disk(tmp_path)
    except OSError as error:
        pytest.skip(f"no loop device can be mounted here: {error}")
    yield disk
    disk.detach()


@pytest.fixture
def lab(tmp_path):
    bench = (RECIPES / "benches" / "lt40-sim.yaml").read_text()
    (tmp_path / "bench.yaml").write_text(bench.replace("x_per_volt", "speed: 1, x_per_volt", 1))
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    return tmp_path


def start(lab, *arguments):
    command = [sys.executable, "-m", "labdrive", *map(str, arguments)]
    return subprocess.Popen(
        command, cwd=lab, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def cut_at(disk, lab, seconds):
    """Start a run, cut the power so long after its first recording began; return what it told."""
    told = []
    with start(lab, "run", "recipe.yaml", "--runs", disk.mount / "runs") as run:
        for line in run.stderr:
            told.append(line)
            if "recording 1: iteration 0" in line:
                break
        timer = threading.Timer(seconds, disk.cut)
        timer.start()
        told += run.stderr.readlines()
        timer.join()
    return told


def check_a_cut(disk, lab, seconds):
    """Cut, mount again: all that was acknowledged is there and whole, and the run goes on."""
    told = cut_at(disk, lab, seconds)
    acknowledged = [int(n) for n in re.findall(r"recording (\d+): on disk as", "".join(told))]
    disk.detach()
    disk.attach()
    (folder,) = (disk.mount / "runs").iterdir()
    journal = read_journal(folder / "journal.jsonl")
    noted = {e["number"]: e for e in journal if e["event"] == "recorded"}
    assert set(acknowledged) <= set(noted)
    for entry in noted.values():
        assert file_sha256(folder / entry["file"]) == entry["sha256"]
    info = json.loads((folder / "run.json").read_text())
    if info["status"] != "done":
        with start(lab, "resume", folder) as again:
            _, error = again.communicate(timeout=120)
        assert again.returncode == 0, error
    result = json.loads((folder / "result.json").read_text())
    shutil.rmtree(disk.mount / "runs")
    return len(acknowledged), result


def test_no_acknowledged_recording_is_lost_to_a_power_cut(disk, lab):
    acknowledged, result = check_a_cut(disk, lab, 1.2)
    assert acknowledged >= 1
    assert result["verification"]["periodic_error"]["rms"] < 5e-9


@pytest.mark.slow
def test_twenty_power_cuts_come_to_one_result(disk, lab):
    moments = np.random.default_rng(1).uniform(0.1, 3.5, 20)
    results = [check_a_cut(disk, lab, seconds)[1] for seconds in moments]
    errors = [result["verification"]["periodic_error"]["rms"] for result in results]
    np.testing.assert_allclose(errors, errors[0], rtol=1e-6)
