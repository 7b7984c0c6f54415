"""What a person sees of a run: a bar on a terminal, plain lines elsewhere."""

import os
import re
import select
import subprocess
import sys
import time

import pytest

pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")


def test_on_a_terminal_a_bar_moves_and_notes_stay(labdrive):
    bench = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
    bench = bench.replace("x_per_volt", "speed: 20, x_per_volt")
    (labdrive.folder / "quick.yaml").write_text(bench)
    ours, theirs = pty.openpty()
    command = ["run", str(labdrive.recipes / "characterize.yaml"), "--bench", "quick.yaml"]
    run = subprocess.Popen(
        [sys.executable, "-m", "labdrive", *command],
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
