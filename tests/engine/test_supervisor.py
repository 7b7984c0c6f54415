"""The process beside a run: what it takes for a sign of life, and what it does without one."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from labdrive.store.durable import write_text

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there is no such process on Windows")

BENCH = Path(__file__).parents[2] / "recipes" / "benches" / "lt40-sim.yaml"
# Shows life as a run does, by a clock of its own: `signs` are its times in s from now.
RUN = """
import os, sys, time
from pathlib import Path
from labdrive.engine.supervisor import MOVING, supervised
folder, bench, last, *signs = sys.argv[1:]
alive = Path(folder, ".alive")
with supervised(Path(folder), bench, 2.0) as supervisor:
    supervisor.tell(MOVING)
    for sign in signs:
        now = time.time() + float(sign)
        alive.touch()
        os.utime(alive, (now, now))
        time.sleep(0.25)
    if last == "freeze":
        time.sleep(60)
    if last == "die":
        os._exit(1)
"""


@pytest.fixture
def folder(tmp_path):
    """A run's folder, as far as a supervisor looks at it."""
    write_text(tmp_path / "run.json", json.dumps({"status": "running"}))
    write_text(tmp_path / "bench.yaml", BENCH.read_text())
    return tmp_path


def run(folder, last, *signs, **environment):
    command = [sys.executable, "-c", RUN, folder, folder / "bench.yaml", last, *map(str, signs)]
    done = subprocess.run(command, check=False, timeout=60, env={**os.environ, **environment})
    return done.returncode


def ended(folder):
    """Wait for the supervisor's word; return what run.json says then."""
    return wait_for(lambda: reason(folder))


def reason(folder):
    return json.loads((folder / "run.json").read_text()).get("reason")


def wait_for(ready, seconds=60):
    deadline = time.monotonic() + seconds
    while not (found := ready()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


def test_a_clock_that_is_set_forward_ends_no_healthy_run(folder):
    # Four seconds of signs, an hour old by the clock as it is now.
    assert run(folder, "end", *(-3600 + 0.25 * i for i in range(16))) == 0
    assert reason(folder) is None


def test_a_clock_that_is_set_back_hides_no_frozen_run(folder):
    assert run(folder, "freeze", 3600) == -signal.SIGKILL
    assert "no sign of life for 2 s while moving" in ended(folder)


BROKEN = """
from labdrive.interfaces import hookimpl
from labdrive_sim.interferometer import Interferometer

class Broken:
    class Settings(Interferometer.Settings):
        pass

    def __init__(self, settings, context):
        FAILS

@hookimpl
def labdrive_sensors():
    return {"broken": Broken}
"""


@pytest.fixture
def broken(tmp_path):
    """Return a function that installs a plugin whose sensor fails; it returns the environment."""

    def install(fails):
        plugin = tmp_path / "plugin"
        (plugin / "broken-1.0.dist-info").mkdir(parents=True)
        (plugin / "broken.py").write_text(BROKEN.replace("FAILS", fails))
        about = plugin / "broken-1.0.dist-info"
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text("[labdrive]\nbroken = broken\n")
        return {"PYTHONPATH": str(plugin)}

    return install


@pytest.mark.parametrize("fails", ["raise RuntimeError('no port')", "raise SystemExit(0)"])
def test_a_plugin_that_fails_leaves_a_word_in_the_folder(folder, broken, fails):
    bench = folder / "bench.yaml"
    bench.write_text(bench.read_text().replace("sim-interferometer", "broken"))
    assert run(folder, "die", 0, **broken(fails)) == 1
    said = ended(folder)
    assert said.startswith("the run's process died; it could not be made safe: ")
    assert ("no port" if "port" in fails else "ended the process") in said
    assert said in (folder / "log.txt").read_text()


def test_a_disk_that_takes_nothing_keeps_no_bench_from_being_made_safe(folder):
    # Neither the lock of the bench nor run.json can be written.
    (folder / ".run.json.part").mkdir()
    assert run(folder, "die", 0, LABDRIVE_STATE="/dev/null/nowhere") == 1
    log = folder / "log.txt"
    wait_for(lambda: log.is_file() and "cannot write" in log.read_text())
    assert "supervisor: the run's process died; made safe: lt40" in log.read_text()
