"""`labdrive schedule` and `serve`: what they refuse, and what they say."""

import pytest

YEARLY = "cron: '0 0 1 1 *'"


@pytest.mark.parametrize("text", ["", "{}", "# all in comments\n"])
def test_a_file_without_schedules_removes_none(lab, text):
    assert lab("schedule", "add", "quick.yaml", "--cron", "0 2 * * *").returncode == 0
    (lab.folder / "schedules.yaml").write_text(text)
    wrong = lab("schedule", "apply", "schedules.yaml", "--prune")
    assert wrong.returncode == 2
    assert "schedules.yaml:1:1: schedules: " in wrong.stderr
    assert "quick" in lab("schedule", "list").stdout


def test_an_empty_list_of_schedules_removes_them_as_it_says(lab):
    assert lab("schedule", "add", "quick.yaml", "--cron", "0 2 * * *").returncode == 0
    (lab.folder / "schedules.yaml").write_text("schedules: []\n")
    assert "quick: removed" in lab("schedule", "apply", "schedules.yaml", "--prune").stdout


def test_a_name_that_two_schedules_have_is_refused_where_it_stands(lab):
    (lab.folder / "schedules.yaml").write_text(
        "schedules:\n"
        f"  - {{name: one, recipe: quick.yaml, {YEARLY}}}\n"
        f"  - {{name: two, recipe: quick.yaml, {YEARLY}}}\n"
        f"  - {{recipe: quick.yaml, name: one, {YEARLY}}}\n"
    )
    wrong = lab("schedule", "apply", "schedules.yaml")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("schedules.yaml:4:32: schedules.2.name: another schedule above")
    assert lab("schedule", "list").stdout == ""


def test_a_paused_schedule_that_is_changed_says_that_it_is_paused(lab):
    add = ("schedule", "add", "quick.yaml", "--cron", "0 2 * * *")
    assert "next due" in lab(*add).stdout
    assert lab("schedule", "pause", "quick").returncode == 0
    assert lab(*add).stdout == "quick: paused; labdrive schedule resume quick lets it be due\n"
    (lab.folder / "schedules.yaml").write_text(
        f"schedules: [{{name: quick, recipe: quick.yaml, {YEARLY}}}]\n"
    )
    assert "quick: paused; " in lab("schedule", "apply", "schedules.yaml").stdout


def test_addresses_that_are_no_text_are_refused_without_what_they_hold(lab):
    path = lab.folder / "state" / "notify.urls"
    path.parent.mkdir()
    path.write_bytes(b"mailto://user:secret\xe4@lab\n")
    path.chmod(0o600)
    wrong = lab("serve", "--once")
    assert wrong.returncode == 2
    assert "notify.urls is not UTF-8 text" in wrong.stderr
    assert "Traceback" not in wrong.stderr
    assert "secret" not in wrong.stderr


def test_a_log_that_cannot_be_written_is_an_error(lab):
    (lab.folder / "state" / "serve.log").mkdir(parents=True)
    wrong = lab("serve", "--once")
    assert wrong.returncode == 1
    assert "serve.log: Is a directory" in wrong.stderr
    assert "Traceback" not in wrong.stderr
