"""Loads that a person places: at a terminal they are asked for, elsewhere the run is refused."""

import json
import os
import re
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request

import pytest

pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")

RECIPE = """kind: load_sweep
bench: hand.yaml
waveforms: [{trajectory: box}]
loads: [0 N, 5 N, 10 N, 15 N]
motion: {periods: 4, samples_per_period: 64, period_rate: 2 Hz, settle_periods: 8}
sensor: interferometer
"""


@pytest.fixture
def by_hand(labdrive):
    bench = (labdrive.recipes / "benches" / "lt40-sim-load.yaml").read_text()
    sim = "{plugin: sim-load, link: plant, kind: friction_pair}"
    assert sim in bench
    (labdrive.folder / "hand.yaml").write_text(bench.replace(sim, "{plugin: weights-by-hand}"))
    (labdrive.folder / "recipe.yaml").write_text(RECIPE)
    return labdrive


def test_an_unattended_run_is_refused_before_anything_moves(by_hand):
    checked = by_hand("check", "recipe.yaml")
    assert checked.returncode == 0
    assert "up to 15 N, placed by a person at the terminal" in checked.stdout
    command = [sys.executable, "-m", "labdrive", "run", "recipe.yaml"]
    done = subprocess.run(
        command,
        cwd=by_hand.folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "hand.yaml:13:16: load.plugin: a person has to place the loads" in done.stderr
    assert not (by_hand.folder / "runs").exists()


def test_at_a_terminal_each_load_is_asked_for_and_what_was_typed_counts(by_hand):
    ours, theirs = pty.openpty()
    # Once more than loads: the bench begins and ends without one.
    os.write(ours, b"\n\n5.5 N\n1 kg\nnonsense\n\n\n")
    done = subprocess.run(
        [sys.executable, "-m", "labdrive", "run", "recipe.yaml", "--json"],
        cwd=by_hand.folder,
        stdin=theirs,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    os.close(theirs)
    os.close(ours)
    assert done.returncode == 0, done.stderr
    loads = [point["load"] for point in json.loads(done.stdout)["points"]]
    assert loads == [0, 5.5, pytest.approx(9.80665), 15]
    assert done.stderr.count("Place a load of") == 6


def test_on_the_page_each_load_is_asked_for_with_a_form(by_hand):
    run = by_hand.start("run", "recipe.yaml", "--json", "--ask-page", "0")
    address = run.stderr.readline().split()[-1]
    answers = iter(["", "", "5.5 N", "1 kg", "", ""])
    question = re.compile(r'<p>(Place a load of .*?)</p>.*name="number" value="(\d+)"', re.DOTALL)
    deadline, seen = time.monotonic() + 60, []
    while run.poll() is None and len(seen) < 6 and time.monotonic() < deadline:
        page = urllib.request.urlopen(address, timeout=10).read().decode()
        found = question.search(page)
        if found is None:
            time.sleep(0.02)
            continue
        seen.append(found[1])
        form = urllib.parse.urlencode({"number": found[2], "answer": next(answers)}).encode()
        # The same form twice, as by an impatient finger: the second must not answer what is next.
        # After the last the run may be over, and its page gone.
        for _ in range(2 if len(seen) < 6 else 1):
            urllib.request.urlopen(address, form, timeout=10).read()
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    assert seen[2].startswith("Place a load of 5 N")
    loads = [point["load"] for point in json.loads(out)["points"]]
    assert loads == [0, 5.5, pytest.approx(9.80665), 15]


def test_a_page_that_cannot_be_served_is_an_error(by_hand):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = by_hand("run", "recipe.yaml", "--ask-page", port)
    assert done.returncode == 2
    assert f"--ask-page {port}: cannot be served" in done.stderr
    assert "Traceback" not in done.stderr
