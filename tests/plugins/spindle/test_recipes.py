"""The shipped recipes as a user runs them: a drive in a process of its own, over a real socket."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

RECIPES = Path(__file__).parents[3] / "recipes"
BENCHES = RECIPES / "benches"
# The same as shipped, faster: 500 SYNCs a second, 5 revolutions a second.
QUICK_CAN = ("motion.samples_per_period=100", "motion.period_rate=5 Hz")
BACKLASH = {"backlash": "12 um"}


def sets(*overrides):
    return [word for override in overrides for word in ("--set", override)]


class User:
    """Types commands in a folder."""

    def __init__(self, folder):
        self.folder = folder

    def start(self, *words):
        return subprocess.Popen(
            [sys.executable, "-m", "labdrive", *map(str, words)],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *words):
        process = self.start(*words)
        out, err = process.communicate(timeout=300)
        return process.returncode, out, err

    def result(self, recipe, bench, *overrides):
        code, out, err = self.run(
            "run", RECIPES / recipe, "--bench", bench, "--json", *sets(*overrides)
        )
        assert code == 0, err
        return json.loads(out)


@pytest.fixture
def user(tmp_path):
    return User(tmp_path)


@pytest.fixture
def can_bench(drive_program, tmp_path):
    """Start a drive and write its bench, with a SYNC of 2 ms."""

    def start(plant=None):
        program = drive_program("canopen", plant=plant)
        bench = program.bench(BENCHES / "spindle-canopen.yaml", tmp_path)
        bench.write_text(bench.read_text().replace("sync_period: 4 ms", "sync_period: 2 ms"))
        return program, bench

    return start


@pytest.fixture
def modbus_bench(drive_program, tmp_path):
    """Start a drive whose clock runs eight times fast, and write its bench."""

    def start(*options, plant=None):
        program = drive_program("modbus", "--speed", "8", *options, plant=plant)
        return program, program.bench(BENCHES / "spindle-modbus.yaml", tmp_path)

    return start


def assert_linear(result):
    """Judge the verification, and the raw recordings behind it, by another fit."""
    before, after = result["iterations"][0], result["verification"]
    floor = after["noise_floor"]["rms"]
    assert before["periodic_error"]["rms"] > 1.5e-6
    assert result["improvement"] >= 20 or after["periodic_error"]["rms"] <= 1.5 * floor


def rms_of(folder, entry, orders=40):
    """Return the rms of the periodic error by plain least squares on the raw recording [m]."""
    with h5py.File(folder / entry["recording"]) as file:
        phase, reading = file["phase"][:], file["encoder"][:]
    waves = [f(k * phase) for k in range(1, orders) for f in (np.cos, np.sin)]
    columns = np.stack([np.ones_like(phase), phase, *waves], axis=1)
    found = np.linalg.lstsq(columns, reading, rcond=None)[0][2:]
    return np.sqrt(np.sum(found**2) / 2)


def test_a_lead_screw_is_linearized_over_canopen(user, can_bench):
    _, bench = can_bench()
    result = user.result("optimize_spindle_canopen.yaml", bench, *QUICK_CAN)
    assert_linear(result)
    folder = user.folder / result["run"]
    assert rms_of(folder, result["iterations"][0]) > 20 * rms_of(folder, result["verification"])


@pytest.mark.parametrize("options", [(), ("--pty",)], ids=["tcp", "rtu"])
def test_a_lead_screw_is_linearized_over_modbus(user, modbus_bench, options):
    _, bench = modbus_bench(*options)
    result = user.result(
        "optimize_spindle_modbus.yaml", bench, "motion.periods=2", "stop.max_iterations=1"
    )
    assert_linear(result)
    folder = user.folder / result["run"]
    before, after = result["iterations"][0], result["verification"]
    assert rms_of(folder, before, 25) > 20 * rms_of(folder, after, 25)


def assert_both_ways(result, backlash):
    assert result["backlash"]["value"] == pytest.approx(backlash, rel=0.02)
    assert result["iso_230_2"]["mean_reversal_value"] == -result["backlash"]["value"]
    for found in result["directions"].values():
        before, after = found["before"], found["corrected"]
        floor = after["noise_floor"]["rms"]
        assert before["periodic_error"]["rms"] == pytest.approx(1.89e-6, rel=0.02)
        better = found["improvement"] >= 20 or after["periodic_error"]["rms"] <= 1.5 * floor
        assert better
    revolution, electrical = result["cycles"]
    assert revolution["forward_before"]["rms"] == pytest.approx(1.868e-6, rel=0.01)
    assert electrical["forward_before"]["rms"] == pytest.approx(0.252e-6, rel=0.05)
    for way in ("forward", "backward"):
        assert electrical[f"{way}_corrected"]["rms"] < electrical[f"{way}_before"]["rms"] / 10


def test_a_spindle_is_characterized_from_both_sides_over_modbus(user, modbus_bench):
    _, bench = modbus_bench(plant=BACKLASH)
    result = user.result("characterize_spindle.yaml", bench, "runs=2")
    assert_both_ways(result, 12e-6)
    page = (user.folder / result["run"] / "report.html").read_text()
    assert "mean reversal value" in page
    assert "bidirectional accuracy A" in page


def test_a_spindle_is_characterized_from_both_sides_over_canopen(user, can_bench):
    _, bench = can_bench(BACKLASH)
    slower = ("motion.samples_per_period=50", "motion.period_rate=2.5 Hz")
    more = ("runs=2", "motion.settle_periods=2", "motion.periods=5", "optimizer.estimator=exact")
    result = user.result("characterize_spindle.yaml", bench, *slower, *more)
    assert_both_ways(result, 12e-6)


def wait_for(process, text):
    """Read standard error up to a line with a text."""
    for line in process.stderr:
        if re.search(text, line):
            return
    raise AssertionError(text)


@pytest.mark.parametrize(("bus", "said"), [("canopen", "nobody was heard"), ("modbus", "not answ")])
def test_a_run_whose_drive_is_unplugged_is_resumed(
    user, can_bench, modbus_bench, drive_program, tmp_path, bus, said
):
    """The plug is pulled in the second recording: the first is not made again."""
    program, bench = can_bench() if bus == "canopen" else modbus_bench()
    quick = QUICK_CAN if bus == "canopen" else ("motion.periods=2", "stop.max_iterations=1")
    recipe = RECIPES / f"optimize_spindle_{bus}.yaml"
    process = user.start("run", recipe, "--bench", bench, *sets(*quick))
    wait_for(process, "recording 2:")
    time.sleep(1)
    program.kill()
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert said in err, err
    assert "Traceback" not in err
    (folder,) = (tmp_path / "runs").glob("2*")
    first = (folder / "recordings" / "0001.h5").stat().st_mtime_ns
    port = ("--port", str(program.where["port"]))
    drive_program(bus, *port, *(["--speed", "8"] if bus == "modbus" else []))
    code, out, err = user.run("resume", folder, "--json")
    assert code == 0, err
    assert_linear(json.loads(out))
    assert (folder / "recordings" / "0001.h5").stat().st_mtime_ns == first


def in_mid_motion(user, bench):
    """Start a run over CANopen and return it while the spindle turns."""
    recipe = RECIPES / "optimize_spindle_canopen.yaml"
    process = user.start("run", recipe, "--bench", bench, *sets(*QUICK_CAN))
    wait_for(process, "recording 1:")
    time.sleep(1)
    return process


def turns(program):
    """Return whether the spindle turns."""
    program.say("state")
    return json.loads(program.process.stdout.readline())["moving"]


def test_ctrl_c_stops_the_spindle(user, can_bench):
    program, bench = can_bench()
    process = in_mid_motion(user, bench)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert turns(program) is False


def test_a_killed_run_leaves_the_spindle_at_rest(user, can_bench):
    """What a killed process cannot say, the drive's own watch on its heartbeat does."""
    program, bench = can_bench()
    process = in_mid_motion(user, bench)
    process.kill()
    process.communicate()
    time.sleep(1.5)
    assert turns(program) is False


def test_a_register_that_is_misspelt_is_pointed_at(user, modbus_bench):
    _, bench = modbus_bench()
    bench.write_text(bench.read_text().replace("address: 0x1001", "addres: 0x1001"))
    code, _, err = user.run("check", RECIPES / "optimize_spindle_modbus.yaml", "--bench", bench)
    assert code == 2
    assert re.search(r"spindle-modbus\.yaml:\d+:\d+: .*addres", err), err


@pytest.mark.slow
@pytest.mark.parametrize("bus", ["canopen", "modbus"])
def test_the_recipe_as_shipped(user, drive_program, tmp_path, bus):
    program = drive_program(bus)
    bench = program.bench(BENCHES / f"spindle-{bus}.yaml", tmp_path)
    assert_linear(user.result(f"optimize_spindle_{bus}.yaml", bench))


@pytest.mark.slow
def test_the_characterization_as_shipped(user, drive_program, tmp_path):
    program = drive_program("modbus", "--speed", "4", plant=BACKLASH)
    bench = program.bench(BENCHES / "spindle-modbus.yaml", tmp_path)
    assert_both_ways(user.result("characterize_spindle.yaml", bench), 12e-6)


def test_an_estimator_that_cannot_use_polled_phases_is_refused_before_moving(user, modbus_bench):
    _, bench = modbus_bench()
    code, _, err = user.run(
        "check",
        RECIPES / "optimize_spindle_modbus.yaml",
        "--bench",
        bench,
        *sets("optimizer.estimator=exact"),
    )
    assert code == 2
    assert "optimizer.estimator: phases will not be equidistant on this bench" in err


ON_CAN = {
    "fault 0x7305": "the drive stopped itself: an error of the incremental encoder",
    "silent": "did not answer the SYNC; nobody was heard",
    "delay 0.4": "answered the SYNC",
    "garble": "a PDO of 3 bytes where",
    "as-node 9": "heard instead: node 9",
    "flood 3": "the bus is flooded",
}
ON_MODBUS = {
    "fault 0x7305": "the drive stopped itself: an error of the incremental encoder",
    "silent": "it does not answer",
    "delay 1": "does not answer",
    "garble": "its answer is damaged or out of turn",
    "as-node 9": "unit 9 answers in its place",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bus", "fault"),
    [("canopen", fault) for fault in ON_CAN] + [("modbus", fault) for fault in ON_MODBUS],
)
def test_whatever_goes_wrong_the_spindle_stops_and_the_run_is_resumed(
    user, can_bench, modbus_bench, tmp_path, bus, fault
):
    program, bench = can_bench() if bus == "canopen" else modbus_bench()
    quick = QUICK_CAN if bus == "canopen" else ("motion.periods=2", "stop.max_iterations=1")
    recipe = RECIPES / f"optimize_spindle_{bus}.yaml"
    process = user.start("run", recipe, "--bench", bench, *sets(*quick))
    wait_for(process, "recording 2:")
    time.sleep(1)
    program.say(fault)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1, err
    assert (ON_CAN if bus == "canopen" else ON_MODBUS)[fault] in err
    assert "Traceback" not in err
    program.say("well")
    time.sleep(4 if fault.startswith("flood") else 1.5)
    assert turns(program) is False
    (folder,) = (tmp_path / "runs").glob("2*")
    code, out, err = user.run("resume", folder, "--json")
    assert code == 0, err
    assert_linear(json.loads(out))
