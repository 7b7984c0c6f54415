"""A run from recipe to result, and every way it can end."""

import contextlib
import hashlib
import json
import os
import signal
import sys
import time

import h5py
import pytest

from labdrive.engine.devices import made_safe
from labdrive.engine.run import run
from labdrive.model.errors import InputError, PluginError
from labdrive.model.events import RecordingStarted, RunEnded

# Windows has no terminals that hang up.
ASKING_TO_END = [
    *(signal.SIGINT, signal.SIGTERM),
    *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []),
]


def told(outcome):
    return json.loads((outcome.folder / "run.json").read_text())


def journal(outcome):
    lines = (outcome.folder / "journal.jsonl").read_text().splitlines()
    return [json.loads(line) for line in lines]


def test_a_memoryless_plant_is_linear_after_one_update(lab):
    outcome = lab.run()
    assert outcome.status == "done"
    rms = [i["periodic_error"]["rms"] for i in outcome.result["iterations"]]
    assert rms[0] == pytest.approx(5e-6 / 2**0.5, rel=1e-6)
    assert rms[1] < 1e-4 * rms[0]
    assert json.loads((outcome.folder / "result.json").read_text()) == outcome.result
    assert outcome.result["verification"]["recording"].endswith(".h5")


def test_the_journal_names_each_intention_before_and_each_recording_after(lab):
    outcome = lab.run()
    events = [(e["event"], e.get("number")) for e in journal(outcome)]
    count = len(outcome.result["iterations"]) + 1
    pairs = [(e, n) for n in range(1, count + 1) for e in ("recording_intended", "recorded")]
    assert events == [("run_started", None), *pairs, ("run_done", None)]
    for entry in journal(outcome):
        if entry["event"] == "recorded":
            data = (outcome.folder / "recordings" / entry["file"].split("/")[-1]).read_bytes()
            assert hashlib.sha256(data).hexdigest() == entry["sha256"]


def test_the_run_folder_says_what_ran(lab):
    outcome = lab.run()
    info = told(outcome)
    assert (info["status"], info["kind"], info["title"]) == ("done", "optimize", "Screw")
    assert info["id"] == outcome.folder.name
    assert info["versions"]["plugins"]["optimizers.fourier"].startswith("labdrive ")
    assert {"recipe.yaml", "bench.yaml", "tables"} <= {p.name for p in outcome.folder.iterdir()}
    assert isinstance(lab.events[-1], RunEnded)


def test_the_verification_samples_finer_than_the_fit(lab):
    outcome = lab.run()
    with h5py.File(outcome.folder / outcome.result["verification"]["recording"]) as file:
        assert file.attrs["samples_per_period"] == 256


def test_returning_walks_every_recording_back(lab):
    outcome = lab.run(lab.recipe.replace("return_to_start: false", "return_to_start: true"))
    assert outcome.status == "done"
    played = [call for call in lab.plant.calls if call.startswith("played")]
    assert played == ["played forward 4", "played backward 0"] * (len(played) // 2)
    assert lab.plant.offset == pytest.approx(0, abs=1e-12)


SAFE_END = ["safe", "drive closed", "probe closed", "link closed"]


@pytest.mark.parametrize(
    ("old", "new", "status", "said"),
    [
        ("plugin: screw", "plugin: screw, fail: play", "failed", "the driver has a bug"),
        ("plugin: probe", "plugin: probe, nan_after: 100", "failed", "not a finite number"),
        ("plugin: probe", "plugin: probe, lost: 1", "failed", "a trigger was missed"),
        ("max: 1 m", "max: 8 mm", "failed", "refused before moving: probe is at 6 mm"),
        ("plugin: probe", "plugin: probe, factor: 300", "stopped", "passed the bench's travel"),
        (
            "plugin: probe}",
            "plugin: probe}, force: {plugin: probe, unit: N, factor: 1e6}",
            "stopped",
            "force passed the bench's force limit",
        ),
        ("plugin: screw", "plugin: screw, fail: connect", "failed", "does not answer"),
    ],
)
def test_whatever_ends_a_run_the_bench_is_left_safe_and_the_folder_says_why(
    lab, old, new, status, said
):
    bench = lab.bench.replace(old, new).replace("limits: {", "limits: {force: 100 N, ")
    outcome = lab.run(bench=bench)
    assert outcome.status == status
    assert said in str(outcome.error)
    assert said in told(outcome)["reason"]
    assert told(outcome)["status"] == status
    assert outcome.error.exit_code == {"failed": 1, "stopped": 3}[status]
    assert "safe" in lab.plant.calls
    ends = (call for call in lab.plant.calls if call == "safe" or "closed" in call)
    assert next(ends) == "safe"
    assert lab.plant.calls[-1] == "link closed"


def test_a_failing_make_safe_keeps_no_other_device_from_its_own(lab, caplog):
    bench = lab.bench.replace(
        "screw: {plugin: screw}",
        "screw: {plugin: screw}, second: {plugin: screw, fail: make_safe}",
    )
    outcome = lab.run(lab.recipe + "actuator: screw\n", bench)
    assert outcome.status == "done"
    assert lab.plant.calls.count("safe") == 2
    assert lab.plant.calls.count("drive closed") == 2
    assert "make_safe failed" in caplog.text


@pytest.mark.parametrize("fail", ["connect", "make_safe"])
def test_what_fails_keeps_no_other_from_being_made_safe(lab, fail):
    both = f"screw: {{plugin: screw, fail: {fail}}}, second: {{plugin: screw}}"
    bench = lab.bench.replace("screw: {plugin: screw}", both)
    devices = lab.prepare(lab.recipe + "actuator: second\n", bench).devices
    failed = made_safe(devices)
    assert list(failed) == ["screw"]
    assert lab.plant.calls.count("safe") == 2
    assert lab.plant.calls[-1] == "link closed"


def test_an_interruption_that_a_plugin_swallows_comes_back(lab):
    prepared = lab.prepare()
    probe = prepared.devices.sensors["probe"]
    read, asked = probe.read, []

    def swallowing(samples):
        if not asked:
            asked.append(True)
            with contextlib.suppress(Exception):
                os.kill(os.getpid(), signal.SIGTERM)
                time.sleep(1)
        return read(samples)

    probe.read = swallowing
    outcome = run(prepared, lab.host, lab.folder / "runs", lab.events.append)
    assert outcome.status == "interrupted"
    assert told(outcome)["reason"] == "stopped by SIGTERM"


@pytest.mark.parametrize("number", ASKING_TO_END)
def test_a_signal_ends_the_run_as_interrupted_with_its_recordings(lab, number):
    def kick(event):
        lab.events.append(event)
        if isinstance(event, RecordingStarted) and event.number == 2:
            os.kill(os.getpid(), number)

    prepared = lab.prepare()
    # Under nohup it would be ignored.
    before = signal.signal(number, signal.default_int_handler)
    outcome = run(prepared, lab.host, lab.folder / "runs", kick)
    signal.signal(number, before)
    assert outcome.status == "interrupted"
    assert outcome.error.exit_code == 130
    assert told(outcome)["reason"] == f"stopped by {number.name}"
    assert [p.name for p in (outcome.folder / "recordings").iterdir()] == ["0001.h5"]
    assert lab.plant.calls[-4:] == SAFE_END


def test_a_plugin_that_ends_the_process_where_it_is_made_is_told(lab, monkeypatch):
    probe = lab.host.plugins.sensors["probe"]
    monkeypatch.setattr(probe, "__init__", lambda *_: sys.exit(0))
    with pytest.raises(PluginError, match=r"sensors\.probe: probe ended the process"):
        lab.prepare()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no SIGHUP")
def test_a_lost_terminal_ends_no_run_that_was_told_to_outlive_it(lab):
    """As nohup does: SIGHUP is ignored before the run begins."""

    def hang_up(event):
        os.kill(os.getpid(), signal.SIGHUP)

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        outcome = run(lab.prepare(), lab.host, lab.folder / "runs", hang_up)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert outcome.status == "done"


@pytest.mark.parametrize("fail", ["play", "make_safe"])
def test_a_plugin_that_ends_the_process_fails_the_run(lab, fail):
    prepared = lab.prepare()
    setattr(prepared.devices.actuator, fail, lambda *_: sys.exit(0))
    outcome = run(prepared, lab.host, lab.folder / "runs", lab.events.append)
    assert outcome.status == told(outcome)["status"] == {"play": "failed"}.get(fail, "done")
    assert fail != "play" or "SystemExit" in told(outcome)["reason"]
    assert lab.plant.calls[-1] == "link closed"


def test_a_signal_while_a_drive_is_made_safe_does_not_cut_that_short(lab):
    prepared = lab.prepare()
    drive, calls = prepared.devices.actuator, lab.plant.calls
    make_safe = drive.make_safe

    def interrupted():
        if "interrupted" not in calls:
            calls.append("interrupted")
            os.kill(os.getpid(), signal.SIGTERM)
        make_safe()

    drive.make_safe = interrupted
    outcome = run(prepared, lab.host, lab.folder / "runs", lab.events.append)
    assert calls[-4:] == SAFE_END
    assert told(outcome)["status"] == outcome.status


def test_a_sensor_on_its_own_clock_gives_real_phases(lab):
    recipe = lab.recipe.replace(
        "use: fourier", "use: fourier, estimator: least_squares, harmonics: 4"
    )
    outcome = lab.run(recipe, lab.bench.replace("plugin: probe", "plugin: probe, own_clock: true"))
    assert outcome.status == "done"
    first = outcome.result["iterations"][0]["harmonics"][0]
    assert first["amplitude"] == pytest.approx(5e-6, rel=2e-3)
    with h5py.File(outcome.folder / "recordings" / "0001.h5") as file:
        assert file.attrs["sampling"] == "polled"


@pytest.mark.parametrize(
    ("recipe", "bench", "line"),
    [
        (("sensor: probe", "sensor: prob"), None, ":5:9: sensor: the bench has no such sensor"),
        (("period: 64", "period: 4096"), None, ":4:42: motion.samples_per_period: too many"),
        (("periods: 4", "periods: 4000"), None, "motion.periods: the run needs"),
        (
            None,
            ("screw: {plugin: screw}", "a: {plugin: screw}, b: {plugin: screw}"),
            "actuator: say which actuator to drive: a, b",
        ),
        (None, ("plugin: screw", "plugin: screw, link: bus"), "actuators.screw.link: the bench"),
        (
            None,
            (
                "probe: {plugin: probe}",
                "probe: {plugin: probe}, k: {plugin: probe, own_clock: true}",
            ),
            "sensor k is polled on a clock of its own",
        ),
        (None, ("plugin: screw", "plugin: screw, unit: V, peak: 12.0"), "outside the bench's 0 to"),
        (
            None,
            ("plugin: screw", "plugin: screw, unit: V, peak: 9.5, jump: 0.5"),
            "slew limit of 100",
        ),
        (None, ("travel: {min: -1 m, max: 1 m}, ", ""), "give limits.travel"),
        (None, ("min: -1 m, max: 1 m", "min: -1 rad, max: 1 rad"), "travels in m"),
        (None, ("slew: 100 V/s", "period_rate: 1 Hz"), "above the bench's limit of 1 Hz"),
        (("use: fourier", "use: fourier, groups: symmetric"), None, "optimizer.groups: this actu"),
    ],
)
def test_what_the_bench_cannot_do_is_refused_before_anything_connects(lab, recipe, bench, line):
    with pytest.raises(InputError) as raised:
        lab.run(
            lab.recipe.replace(*recipe) if recipe else None,
            lab.bench.replace(*bench) if bench else None,
        )
    (problem,) = raised.value.problems
    assert line in str(problem)
    assert problem.file.endswith(".yaml")
    assert not (lab.folder / "runs").exists()


def test_what_holds_a_recording_back_is_told_once_however_its_sensor_flickers(lab, monkeypatch):
    monkeypatch.setattr("labdrive.engine.bench.LOOK_AGAIN_S", 0.01)
    force = "force: {plugin: gauge, unit: N, factor: 0, rest: [6, 7, 5, 3]}"
    bench = lab.bench.replace("probe: {plugin: probe}", f"probe: {{plugin: probe}}, {force}")
    bench += "interlocks: [{sensor: force, below: 4 N, action: hold}]\n"
    outcome = lab.run(bench=bench)
    assert outcome.status == "done"
    held = [entry["reason"] for entry in journal(outcome) if entry["event"] == "held_back"]
    assert held == ["force reads 6 N, the bench asks for force below 4 N"]
