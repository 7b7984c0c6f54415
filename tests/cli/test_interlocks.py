"""Interlocks of a bench, tripped in real runs."""

import json
import re
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from labdrive.store.journal import read_journal

RECIPE = """kind: characterize
bench: bench.yaml
waveform: {trajectory: box}
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz}
sensor: interferometer
"""


@pytest.fixture
def lab(labdrive):
    (labdrive.folder / "recipe.yaml").write_text(RECIPE)

    def bench(interlock, sensor="sim-interferometer,", speed="fast"):
        text = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
        text = text.replace("sim-interferometer,", sensor)
        text = text.replace("x_per_volt", f"speed: {speed}, x_per_volt", 1)
        (labdrive.folder / "bench.yaml").write_text(text + f"interlocks:\n  - {interlock}\n")

    labdrive.bench = bench
    return labdrive


def run_json(lab):
    (folder,) = (lab.folder / "runs").iterdir()
    return folder, json.loads((folder / "run.json").read_text())


def elsewhen():
    """Return a span of the day that does not hold now."""
    now = datetime.now(UTC)
    return f"{now + timedelta(hours=2):%H:%M}-{now + timedelta(hours=3):%H:%M}"


def test_a_reading_beyond_a_bound_stops_the_run_and_says_how_late(lab):
    lab.bench("{sensor: force, below: 0.4 N}", speed="1")
    done = lab("run", "recipe.yaml")
    assert done.returncode == 3
    _, info = run_json(lab)
    assert info["status"] == "stopped"
    assert "the bench asks for force below 400 mN; halted" in info["reason"]
    # A chunk of the simulated generator lasts 50 ms.
    assert int(re.search(r"halted (\d+) ms later", info["reason"])[1]) <= 50


def test_a_paused_recording_is_made_again_and_what_it_read_is_kept(lab):
    faulty = "sim-faulty-interferometer, fault: lie, off: 1 mm, motions: 1,"
    pause = "{sensor: interferometer, below: 0.5 mm, action: pause, again_after: 0.1 s}"
    lab.bench(pause, sensor=faulty, speed="1")
    done = lab("run", "recipe.yaml")
    assert done.returncode == 0, done.stderr
    assert "paused: interferometer read 1" in done.stderr
    folder, info = run_json(lab)
    assert info["status"] == "done"
    events = [entry["event"] for entry in read_journal(folder / "journal.jsonl")]
    assert events.count("paused") == events.count("recorded") == 1
    assert lab("replay", folder).returncode == 0


def test_the_wrong_time_of_day_stops_or_holds_back_a_start(lab):
    lab.bench(f"{{between: '{elsewhen()}'}}")
    stopped = lab("run", "recipe.yaml")
    assert stopped.returncode == 3
    assert "not started: the bench is to be used only" in stopped.stderr
    lab.bench(f"{{between: '{elsewhen()}', action: hold}}")
    held = lab.start("run", "recipe.yaml", "--runs", "held")
    deadline = time.monotonic() + 30
    while "held back: the bench is to be used only" not in held.stderr.readline():
        assert time.monotonic() < deadline
    held.send_signal(signal.SIGINT)
    held.communicate(timeout=30)
    assert held.returncode == 130
    assert not list(lab.folder.glob("held/*/recordings/*.h5"))


def test_a_sensor_that_can_be_read_at_rest_holds_back_a_start(lab):
    lab.bench("{sensor: force, above: 1 N, action: hold}")
    held = lab.start("run", "recipe.yaml")
    deadline = time.monotonic() + 30
    while "held back: force reads 0 N, the bench asks for force above 1 N" not in (
        held.stderr.readline()
    ):
        assert time.monotonic() < deadline
    held.send_signal(signal.SIGINT)
    held.communicate(timeout=30)
    assert held.returncode == 130
    lab.bench("{sensor: interferometer, above: 1 m, action: hold}")
    done = lab("check", "recipe.yaml")
    assert done.returncode == 2
    assert re.match(
        r"bench\.yaml:\d+:\d+: interlocks\.0\.action: interferometer cannot be read", done.stderr
    )


THERMOMETER = "  temperature: {plugin: sim-thermometer, mean: MEAN, swing: 0 K}\n"


def test_the_temperature_stops_a_run_or_holds_back_its_start(lab):
    def bench(mean, interlock):
        lab.bench(interlock)
        path = lab.folder / "bench.yaml"
        thermometer = THERMOMETER.replace("MEAN", mean)
        path.write_text(path.read_text().replace("sensors:\n", "sensors:\n" + thermometer))

    bench("294 K", "{sensor: temperature, within: 0.5 K, of: 293.15 K}")
    stopped = lab("run", "recipe.yaml", "--runs", "stopped")
    assert stopped.returncode == 3
    assert "temperature read 294" in stopped.stderr
    bench("294 K", "{sensor: temperature, within: 0.5 K, of: 293.15 K, action: hold}")
    held = lab.start("run", "recipe.yaml", "--runs", "held")
    said = "held back: temperature reads 294 K, the bench asks for temperature within 500 mK of"
    wait_for(lambda: said in held.stderr.readline())
    held.send_signal(signal.SIGINT)
    held.communicate(timeout=30)
    assert held.returncode == 130


def test_what_was_read_first_is_remembered_over_a_kill(lab):
    lab.bench("{sensor: temperature, within: 0.5 K}", speed="1")
    path = lab.folder / "bench.yaml"
    thermometer = THERMOMETER.replace("MEAN", "293 K")
    path.write_text(path.read_text().replace("sensors:\n", "sensors:\n" + thermometer))
    optimize = RECIPE.replace("characterize", "optimize") + "optimizer: {use: fourier}\n"
    (lab.folder / "recipe.yaml").write_text(optimize)
    run = lab.start("run", "recipe.yaml")
    wait_for(lambda: list(lab.folder.glob("runs/*/recordings/0001.h5")))
    wait_for(lambda: list(lab.folder.glob("runs/*/recordings/0002.spool")))
    run.kill()
    run.communicate()
    folder, _ = run_json(lab)
    wait_for(lambda: "made safe" in json.loads((folder / "run.json").read_text())["reason"])
    kept = folder / "bench.yaml"
    warmer = kept.read_text().replace("mean: 293 K", "mean: 294 K")
    assert warmer != kept.read_text()
    kept.write_text(warmer)
    resumed = lab("resume", folder)
    assert resumed.returncode == 3, resumed.stderr
    assert re.search(
        r"temperature read 294\S* K, the bench asks for temperature within 500 mK of its first",
        resumed.stderr,
    )


def test_conditions_that_do_not_fit_the_bench_are_told_by_line(lab):
    lab.bench("{sensor: thermometer, below: 300 K}\n  - {sensor: force, below: 3 K}")
    done = lab("check", "recipe.yaml")
    assert done.returncode == 2
    first, second = done.stderr.splitlines()
    assert re.match(r"bench\.yaml:\d+:\d+: interlocks\.0\.sensor: the bench has no such", first)
    assert re.match(r"bench\.yaml:\d+:\d+: interlocks\.1: force reads N", second)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("time_out", "timed out after 1 s; check its cable"),
        ("disconnect", "does not answer; is it switched on?"),
        ("nan", "not a finite number"),
        ("stuck", "has not changed"),
    ],
)
def test_a_sensor_that_fails_ends_the_run_with_its_reason(lab, fault, says):
    lab.bench("{sensor: force, below: 39 N}", sensor=f"sim-faulty-interferometer, fault: {fault},")
    done = lab("run", "recipe.yaml")
    assert done.returncode == 1
    assert says in done.stderr
    _, info = run_json(lab)
    assert info["status"] == "failed"
    assert says in info["reason"]
    assert "Traceback" not in done.stderr


# Of 2 settling and 4 recorded cycles, and the sample that closes the last.
WALKED = 6 * 64 + 1


@pytest.mark.parametrize(
    ("after", "recorded"), [(4 * 64, 0), (WALKED + 4 * 64, 1)], ids=["recording", "walking back"]
)
def test_a_reading_that_freezes_on_the_way_halts_it(lab, after, recorded):
    faulty = f"sim-faulty-interferometer, fault: stuck, after: {after},"
    lab.bench("{sensor: force, below: 39 N}", sensor=faulty, speed="1")
    done = lab("run", "recipe.yaml")
    assert done.returncode == 1
    cycles = re.search(r"sensor interferometer read \S+ for (\S+) cycles of motion", done.stderr)
    assert 1 <= float(cycles[1]) <= 2
    folder, info = run_json(lab)
    assert info["status"] == "failed"
    assert len(list(folder.glob("recordings/*.h5"))) == recorded


def test_a_sensor_that_falls_silent_on_the_walk_back_ends_the_run(lab):
    faulty = f"sim-faulty-interferometer, fault: silent, after: {WALKED},"
    lab.bench("{sensor: force, below: 39 N}", sensor=faulty)
    done = lab("run", "recipe.yaml")
    assert done.returncode == 1
    assert "sensor interferometer gave 0 readings for" in done.stderr
    folder, _ = run_json(lab)
    assert list(folder.glob("recordings/0001.h5"))


@pytest.mark.parametrize("after", [0, 100])
def test_a_polled_sensor_that_falls_silent_ends_the_run_while_it_moves(lab, after):
    faulty = f"sim-faulty-interferometer, fault: silent, after: {after}, sampling: polled,"
    lab.bench("{sensor: interferometer, below: 1 m}", sensor=faulty, speed="1")
    bench = lab.folder / "bench.yaml"
    alone = bench.read_text().replace("  force: {plugin: sim-force, link: plant}\n", "")
    bench.write_text(alone.replace("limits:\n", "limits:\n  silence: 2 s\n"))
    long = ("--set", "motion.periods=80", "--set", "estimator=least_squares")
    done = lab("run", "recipe.yaml", *long)
    assert done.returncode == 1, done.stderr
    assert re.search(r"gave no reading for 2(\.0\d*)? s of motion", done.stderr), done.stderr
    assert not list(lab.folder.glob("runs/*/recordings/*.h5"))


def wait_for(ready, seconds=30):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if ready():
            return
        time.sleep(0.05)
    raise AssertionError("waited in vain")


def test_a_run_that_is_killed_while_moving_has_its_bench_made_safe_from_outside(lab):
    lab.bench("{sensor: force, below: 39 N}", speed="0.1")
    run = lab.start("run", "recipe.yaml")
    wait_for(lambda: list(lab.folder.glob("runs/*/recordings/*.spool")))
    run.kill()
    run.communicate()
    folder, _ = run_json(lab)
    wait_for(lambda: "made safe" in json.loads((folder / "run.json").read_text())["reason"])
    _, info = run_json(lab)
    assert info["status"] == "failed"
    assert info["reason"] == "the run's process died; made safe: lt40"
    assert "supervisor: the run's process died" in (folder / "log.txt").read_text()
    assert lab("resume", folder).returncode == 0


def test_a_run_that_freezes_while_moving_is_ended_and_its_bench_made_safe(lab):
    lab.bench("{sensor: force, below: 39 N}", sensor="sim-faulty-interferometer, fault: freeze,")
    bench = lab.folder / "bench.yaml"
    bench.write_text(bench.read_text().replace("limits:\n", "limits:\n  silence: 2 s\n"))
    began = time.monotonic()
    done = lab("run", "recipe.yaml")
    assert done.returncode == -signal.SIGKILL
    assert time.monotonic() - began < 20
    folder, _ = run_json(lab)
    wait_for(lambda: "made safe" in json.loads((folder / "run.json").read_text())["reason"])
    _, info = run_json(lab)
    assert "no sign of life for 2 s while moving" in info["reason"]


HEEDLESS = """
import sys, time
from pathlib import Path
from labdrive.engine.supervisor import MOVING, supervised
folder, bench = sys.argv[1:]
with supervised(Path(folder), bench, 60.0) as supervisor:
    supervisor.tell(MOVING)
    supervisor.tell_bounds("encoder", -1.0, 1.0)
    supervisor.tell_reading("encoder", -0.5, 0.5)
    for _ in range(600):
        supervisor.tell_reading("encoder", 0.5, float(sys.stdin.readline() or 1.5))
        time.sleep(0.1)
"""


def test_a_run_that_passes_a_limit_and_moves_on_is_ended_from_outside(lab):
    """What the run itself should have done within a chunk, its supervisor does."""
    lab.bench("{sensor: force, below: 39 N}")
    assert lab("run", "recipe.yaml").returncode == 0
    folder, info = run_json(lab)
    (folder / "run.json").write_text(json.dumps({**info, "status": "running"}))
    run = subprocess.Popen(
        [sys.executable, "-c", HEEDLESS, folder, lab.folder / "bench.yaml"],
        stdin=subprocess.PIPE,
        text=True,
    )
    run.communicate("0.9\n" * 10 + "1.5\n", timeout=30)
    assert run.returncode == -signal.SIGKILL
    wait_for(lambda: "made safe" in json.loads((folder / "run.json").read_text())["reason"])
    _, info = run_json(lab)
    assert "encoder read 1.5, beyond -1 to 1, and the run moved on" in info["reason"]


def test_nothing_is_left_running_after_a_run(lab):
    lab.bench("{sensor: force, below: 39 N}")
    assert lab("run", "recipe.yaml").returncode == 0
    folder, info = run_json(lab)
    assert info["status"] == "done"

    def watched():
        commands = map(_command, Path("/proc").glob("[0-9]*/cmdline"))
        return any(b"supervise" in c and folder.name.encode() in c for c in commands)

    wait_for(lambda: not watched())


def _command(path):
    try:
        return path.read_bytes()
    except OSError:  # it has ended since
        return b""
