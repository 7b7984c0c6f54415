"""`labdrive schedule`, `serve` and `safe` as a user types them: real processes, real kills."""

import json
import re
import signal
import sqlite3
from pathlib import Path

from .lab import QUICK


def test_added_listed_due_and_run(lab):
    added = lab("schedule", "add", "quick.yaml", "--cron", "* * * * *", "--tz", "Europe/Berlin")
    assert added.returncode == 0, added.stderr
    assert re.search(r"quick: next due \d{4}-\d\d-\d\dT\d\d:\d\d[+-]\d\d:\d\d", added.stdout)
    lab.make_due("quick")
    served = lab("serve", "--once")
    assert served.returncode == 0, served.stdout
    states = {state for state, *_ in lab.jobs()}
    assert states == {"done"}
    for _, _, run, _ in lab.jobs():
        assert json.loads((Path(run) / "run.json").read_text())["status"] == "done"
    listed = lab("schedule", "list")
    assert "quick" in listed.stdout
    assert "done" in listed.stdout
    assert lab("schedule", "pause", "quick").returncode == 0
    assert "paused" in lab("schedule", "list").stdout
    assert lab("schedule", "resume", "quick").returncode == 0
    assert len(lab("schedule", "next", "--count", "3").stdout.splitlines()) == 3
    assert lab("schedule", "remove", "quick").returncode == 0
    again = lab("schedule", "remove", "quick")
    assert again.returncode == 2
    assert "there is no schedule quick" in again.stderr


def test_schedules_kept_in_git_are_applied_and_mistakes_told_by_line(lab):
    path = lab.folder / "schedules.yaml"
    path.write_text(
        "schedules:\n"
        "  - {name: nightly, recipe: quick.yaml, cron: '0 2 * * *', tz: Europe/Berlin}\n"
        "  - {name: noon, recipe: quick.yaml, cron: '0 12 * * *', overlap: skip}\n"
    )
    assert lab("schedule", "apply", "schedules.yaml").returncode == 0
    path.write_text(
        path.read_text().splitlines(keepends=True)[0]
        + "  - "
        + "{name: noon, recipe: quick.yaml, cron: '0 13 * * *'}\n"
    )
    assert "nightly: removed" in lab("schedule", "apply", "schedules.yaml", "--prune").stdout
    assert "0 13 * * *" in lab("schedule", "list").stdout
    path.write_text(
        "schedules:\n  - {name: n, recipe: gone.yaml, cron: 'x', tz: Nowhere, mised: skip}\n"
    )
    wrong = lab("schedule", "apply", "schedules.yaml")
    assert wrong.returncode == 2
    for text in ("schedules.yaml:2:", "no file", "cron expression", "no time zone", "mised"):
        assert text in wrong.stderr
    assert "Traceback" not in wrong.stderr


def test_a_recipe_that_cannot_be_run_is_refused_when_it_is_scheduled(lab):
    (lab.folder / "wrong.yaml").write_text(QUICK.replace("box", "bax"))
    wrong = lab("schedule", "add", "wrong.yaml", "--cron", "* * * * *")
    assert wrong.returncode == 2
    assert "did you mean box?" in wrong.stderr


def test_a_run_that_hangs_is_stopped_and_its_bench_made_safe(lab):
    add = ("schedule", "add", "quick.yaml", "--bench", "faulty.yaml", "--cron", "* * * * *")
    assert lab(*add, "--hang-after", "2 s").returncode == 0
    lab.make_due("quick")
    serve = lab.start("serve")
    try:
        lab.wait(lambda: any(state == "failed" for state, *_ in lab.jobs()))
    finally:
        serve.send_signal(signal.SIGTERM)
        serve.communicate(timeout=60)
    reason, run = next((r, f) for state, r, f, _ in lab.jobs() if state == "failed")
    assert "no sign of life for 2 s; its bench was made safe" in reason
    assert json.loads((Path(run) / "run.json").read_text())["status"] == "interrupted"


def test_a_stopped_service_stops_its_run_and_the_next_one_goes_on_with_it(lab):
    add = ("schedule", "add", "quick.yaml", "--bench", "slow.yaml", "--cron", "0 0 1 1 *")
    assert lab(*add).returncode == 0
    with sqlite3.connect(lab.folder / "state" / "queue.sqlite") as db:
        bench = str(lab.folder / "slow.yaml")
        db.execute(
            "INSERT INTO jobs (schedule, due, bench, state) VALUES "
            "('quick', '2026-01-01T00:00:00+00:00', ?, 'queued')",
            (bench,),
        )
    serve = lab.start("serve")
    lab.wait(lambda: list(lab.folder.glob("runs/*/journal.jsonl")))
    serve.send_signal(signal.SIGTERM)
    out, _ = serve.communicate(timeout=60)
    assert serve.returncode == 0, out
    (folder,) = lab.folder.glob("runs/*")
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"
    assert [state for state, *_ in lab.jobs()] == ["queued"]
    assert lab("serve", "--once", timeout=200).returncode == 0
    assert json.loads((folder / "run.json").read_text())["status"] == "done"
    ((state, _, run, attempts),) = lab.jobs()
    assert (state, run, attempts) == ("done", str(folder), 2)
    assert len(list(lab.folder.glob("runs/*"))) == 1


def test_a_killed_service_loses_nothing(lab):
    add = ("schedule", "add", "quick.yaml", "--bench", "slow.yaml", "--cron", "* * * * *")
    assert lab(*add, "--overlap", "skip").returncode == 0
    lab.make_due("quick")
    serve = lab.start("serve")
    lab.wait(lambda: list(lab.folder.glob("runs/*/journal.jsonl")))
    serve.kill()
    serve.communicate()
    assert lab("schedule", "pause", "quick").returncode == 0
    # The run itself lives on, in a session of its own; the next service watches it to its end.
    again = lab.start("serve")
    try:
        lab.wait(lambda: {state for state, *_ in lab.jobs()} <= {"done", "skipped"}, timeout=120)
    finally:
        again.send_signal(signal.SIGTERM)
        again.communicate(timeout=60)
    runs = [json.loads(path.read_text()) for path in lab.folder.glob("runs/*/run.json")]
    assert [info["status"] for info in runs] == ["done"] * len(runs)
    printed = "".join(path.read_text() for path in lab.folder.glob("state/jobs/*.log"))
    assert printed.count(": done") == len(runs)
    assert "in use" not in printed


def test_a_run_that_hangs_after_its_service_was_killed_is_stopped_as_well(lab):
    add = ("schedule", "add", "quick.yaml", "--bench", "faulty.yaml", "--cron", "* * * * *")
    assert lab(*add, "--hang-after", "4 s").returncode == 0
    lab.make_due("quick")
    serve = lab.start("serve")
    lab.wait(lambda: list(lab.folder.glob("runs/*/journal.jsonl")))
    serve.kill()
    serve.communicate()
    assert lab("schedule", "pause", "quick").returncode == 0
    assert lab("serve", "--once").returncode == 1
    state, reason, run, attempts = lab.jobs()[0]
    assert (state, attempts) == ("failed", 2)
    assert reason == "hung: no sign of life for 4 s; its bench was made safe"
    assert json.loads((Path(run) / "run.json").read_text())["status"] == "interrupted"


def test_a_queue_made_anew_does_not_take_older_runs_for_its_own(lab):
    add = ("schedule", "add", "quick.yaml", "--cron", "* * * * *")
    assert lab(*add).returncode == 0
    lab.make_due("quick")
    assert lab("serve", "--once").returncode == 0
    for path in lab.folder.glob("state/queue.sqlite*"):
        path.unlink()
    assert lab(*add).returncode == 0
    with sqlite3.connect(lab.folder / "state" / "queue.sqlite") as db:
        bench = str(lab.folder / "bench.yaml")
        query = "INSERT INTO jobs (schedule, due, bench, state) VALUES ('quick', ?, ?, 'queued')"
        db.execute(query, ("2026-01-01T00:00:00+00:00", bench))
    (lab.folder / "quick.yaml").write_text(QUICK.replace("box", "bax"))
    assert lab("serve", "--once").returncode == 1
    state, reason, run, _ = lab.jobs()[0]
    assert (state, run) == ("failed", None)
    assert "did you mean box?" in reason


def test_a_job_store_that_cannot_be_read_is_an_error(lab):
    path = lab.folder / "state" / "queue.sqlite"
    path.parent.mkdir()
    path.write_text("this is no database, however long one looks at it" * 100)
    done = lab("schedule", "list")
    assert done.returncode == 1
    assert f"the job store {path}" in done.stderr
    assert "Traceback" not in done.stderr


def test_safe_makes_a_bench_safe_and_names_what(lab):
    done = lab("safe", "bench.yaml")
    assert done.returncode == 0
    assert done.stdout == "safe: lt40\n"
    assert lab("safe", "nowhere.yaml").returncode == 2
    dead = (lab.folder / "faulty.yaml").read_text().replace("fault: freeze", "fault: disconnect")
    (lab.folder / "dead.yaml").write_text(dead)
    assert lab("safe", "dead.yaml").stdout == "safe: lt40\n"
