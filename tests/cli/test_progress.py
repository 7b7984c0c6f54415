"""What a person sees of a run: a bar on a terminal, plain lines elsewhere."""

import json
import os
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")


def test_on_a_terminal_a_bar_moves_and_notes_stay(labdrive):
    ours, theirs = pty.openpty()
    run = subprocess.Popen(
        _quick(labdrive),
        cwd=labdrive.folder,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "100"},
    )
    os.close(theirs)
    seen = _read_all(ours, time.monotonic() + 60)
    assert run.wait(timeout=30) == 0
    assert "characterization" in seen
    assert len(set(re.findall(r"(\d+)/8193", seen))) > 2
    assert "walking back" in seen


def _quick(labdrive):
    bench = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
    (labdrive.folder / "quick.yaml").write_text(
        bench.replace("x_per_volt", "speed: 20, x_per_volt")
    )
    recipe = str(labdrive.recipes / "characterize.yaml")
    return [sys.executable, "-m", "labdrive", "run", recipe, "--bench", "quick.yaml"]


def _status(labdrive):
    (folder,) = (labdrive.folder / "runs").iterdir()
    return json.loads((folder / "run.json").read_text())["status"]


def test_a_terminal_that_is_lost_fails_no_run(labdrive):
    ours, theirs = pty.openpty()
    run = subprocess.Popen(
        _quick(labdrive),
        cwd=labdrive.folder,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm"},
    )
    os.close(theirs)
    os.read(ours, 1)
    os.close(ours)
    assert run.wait(timeout=60) == 0
    assert _status(labdrive) == "done"


def test_a_pipe_that_nobody_reads_any_more_fails_no_run(labdrive):
    run = subprocess.Popen(
        _quick(labdrive), cwd=labdrive.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    run.stderr.readline()
    run.stderr.close()
    assert run.wait(timeout=60) == 0
    assert _status(labdrive) == "done"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_behind_a_redirection_fails_no_run(labdrive):
    with Path("/dev/full").open("w") as full:
        command = _quick(labdrive)
        done = subprocess.run(command, cwd=labdrive.folder, stderr=full, timeout=60, check=False)
    assert done.returncode == 0
    assert _status(labdrive) == "done"


def _read_all(terminal, until):
    parts = []
    while time.monotonic() < until and select.select([terminal], [], [], 30)[0]:
        try:
            part = os.read(terminal, 4096)
        except OSError:  # Linux says so when the other side is closed.
            break
        if not part:
            break
        parts.append(part)
    os.close(terminal)
    return b"".join(parts).decode()
