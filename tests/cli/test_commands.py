"""Every command from the outside: what it prints, where, and its exit code."""

import json
import signal
import time

import pytest

QUICK = ("--set", "motion.periods=4", "--set", "stop.max_iterations=1")


def test_check_prints_the_plan_and_makes_nothing(labdrive):
    done = labdrive("check", labdrive.recipes / "optimize.yaml")
    assert done.returncode == 0, done.stderr
    assert "up to 9 x 2 + 32 cycles forward at 2 Hz, 256 samples a cycle, and back" in done.stdout
    # 10 recordings of 34 cycles, there and back.
    assert "cycles walked   680" in done.stdout
    assert "duration        about 0:05:40" in done.stdout
    for word in ("travel needed", "of the bench's 20 mm", "disk"):
        assert word in done.stdout
    assert list(labdrive.folder.iterdir()) == []


def test_the_plan_is_what_a_run_then_does(labdrive):
    done = labdrive("run", labdrive.recipes / "characterize.yaml", "--json")
    folder = labdrive.folder / json.loads(done.stdout)["run"]
    size = sum(file.stat().st_size for file in (folder / "recordings").iterdir())
    plan = labdrive("check", labdrive.recipes / "characterize.yaml").stdout
    value, unit = plan.split("disk            about ")[1].split()[:2]
    planned = float(value) * {"kB": 1e3, "MB": 1e6}[unit]
    assert size == pytest.approx(planned, rel=0.1)


def test_run_with_json_prints_one_object_and_keeps_progress_on_stderr(labdrive):
    done = labdrive("run", labdrive.recipes / "optimize.yaml", "--json", *QUICK)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    folder = labdrive.folder / result.pop("run")
    assert result == json.loads((folder / "result.json").read_text())
    assert "recording 1: iteration 0" in done.stderr
    assert (folder / "report.html").stat().st_size > 10_000


def test_run_says_where_the_report_is_and_report_writes_the_same_again(labdrive):
    done = labdrive("run", labdrive.recipes / "characterize.yaml")
    assert done.returncode == 0, done.stderr
    report = labdrive.folder / done.stdout.splitlines()[-1].removeprefix("report").strip()
    before = report.read_bytes()
    report.unlink()
    assert labdrive("report", report.parent).returncode == 0
    assert report.read_bytes() == before


def test_runs_lists_and_shows(labdrive):
    labdrive("run", labdrive.recipes / "characterize.yaml", *QUICK[:2])
    (line,) = labdrive("runs").stdout.splitlines()
    identity, status, title = line.split(maxsplit=2)
    assert (status, title) == ("done", "Periodic error of the LT40, box")
    assert json.loads(labdrive("runs", "show", identity).stdout)["id"] == identity


def test_a_resolved_recipe_and_bench_run_again_to_the_same_result(labdrive):
    first = json.loads(labdrive("run", labdrive.recipes / "optimize.yaml", "--json", *QUICK).stdout)
    folder = labdrive.folder / first["run"]
    again = labdrive("run", folder / "recipe.yaml", "--bench", folder / "bench.yaml", "--json")
    second = json.loads(again.stdout)
    assert {**second, "run": ""} == {**first, "run": ""}


def test_every_mistake_comes_out_at_once_with_its_place_and_nothing_runs(labdrive):
    text = (labdrive.recipes / "optimize.yaml").read_text()
    bench = labdrive.recipes / "benches" / "lt40-sim.yaml"
    text = text.replace("bench: benches/lt40-sim.yaml", f"bench: {bench}")
    text = text.replace("period_rate: 2 Hz", "period_rate: 2").replace("estimator", "estimater")
    (labdrive.folder / "wrong.yaml").write_text(text)
    for command in ("check", "run"):
        done = labdrive(command, "wrong.yaml")
        assert done.returncode == 2
        assert done.stdout == ""
        first, second = done.stderr.splitlines()
        assert first.startswith("wrong.yaml:6:61: motion.period_rate: ")
        assert "needs a unit" in first
        assert second.startswith("wrong.yaml:8:27: optimizer.estimater: ")
        assert "estimator" in second
    assert not (labdrive.folder / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "nowhere.yaml"), "nowhere.yaml"),
        (("check", "."), "Is a directory"),
        (("report", "nowhere"), "nowhere"),
        (("runs", "show"), "say which run"),
    ],
)
def test_a_wrong_command_is_one_line_and_exit_code_2(labdrive, arguments, said):
    done = labdrive(*arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_ctrl_c_in_mid_motion_leaves_a_folder_that_says_interrupted(labdrive):
    bench = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
    bench = bench.replace("x_per_volt", "speed: 1, x_per_volt")
    (labdrive.folder / "slow.yaml").write_text(bench)
    run = labdrive.start("run", labdrive.recipes / "optimize.yaml", "--bench", "slow.yaml")
    for line in run.stderr:
        if "recording 1" in line:
            break
    time.sleep(1)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=30)
    assert run.returncode == 130
    assert "interrupted: stopped by SIGINT" in errors
    assert "Traceback" not in errors
    (folder,) = (labdrive.folder / "runs").iterdir()
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"
    assert list((folder / "recordings").iterdir()) == []
    assert "interrupted" in (folder / "report.html").read_text()


def test_plugins_lists_each_with_its_distribution(labdrive):
    found = json.loads(labdrive("plugins", "--json").stdout)
    assert {"role": "optimizers", "name": "fourier"}.items() <= next(
        plugin for plugin in found["plugins"] if plugin["name"] == "fourier"
    ).items()
    assert found["broken"] == []
    assert "sim-walking-actuator" in labdrive("plugins").stdout


def test_schema_writes_what_an_editor_reads(labdrive):
    assert labdrive("schema", "--out", "schemas").returncode == 0
    recipe = json.loads((labdrive.folder / "schemas" / "recipe.schema.json").read_text())
    bench = json.loads(labdrive("schema", "bench").stdout)
    assert "shared_phase" in json.dumps(recipe)
    assert "sim-walking-drive" in json.dumps(bench)


def test_recipes_can_be_copied_and_run_from_there(labdrive):
    done = labdrive("recipes", "--copy", "mine")
    assert done.returncode == 0
    assert "optimize.yaml" in done.stdout
    assert labdrive("check", "mine/optimize.yaml").returncode == 0
    assert labdrive("recipes", "--copy", "mine").returncode == 2


def test_runs_that_do_not_fit_the_disk_are_refused_before_anything_moves(labdrive):
    recipe = labdrive.recipes / "characterize.yaml"
    endless = ("motion.periods=100000000", "motion.samples_per_period=4096")
    sets = [part for override in endless for part in ("--set", override)]
    bench = (labdrive.recipes / "benches" / "lt40-sim.yaml").read_text()
    (labdrive.folder / "long.yaml").write_text(bench.replace("10 mm", "10 km"))
    done = labdrive("run", recipe, *sets, "--bench", "long.yaml")
    assert done.returncode == 1
    assert "free; make room (labdrive runs prune)" in done.stderr
    assert not (labdrive.folder / "runs").exists()


def test_trend_and_prune_over_a_few_runs(labdrive):
    recipe = labdrive.recipes / "characterize.yaml"
    for seed in range(5):
        sets = ("--set", "motion.periods=4", "--set", f"seed={seed}")
        assert labdrive("run", recipe, *sets).returncode == 0
    told = labdrive("runs", "trend", "--plot", "chart.svg")
    assert told.returncode == 0, told.stderr
    assert len(told.stdout.splitlines()) == 7
    assert "control limits" in told.stdout
    assert (labdrive.folder / "chart.svg").is_file()
    assert labdrive("runs", "trend", "--metric", "no.such").returncode == 2
    assert labdrive("runs", "prune").returncode == 2
    assert labdrive("runs", "prune", "--keep", "2", "--dry-run").stdout.count("would go") == 3
    assert labdrive("runs", "prune", "--keep", "2").stdout.count("gone") == 3
    assert len(labdrive("runs", "list").stdout.splitlines()) == 2
    assert len(labdrive("runs").stdout.splitlines()) == 2
