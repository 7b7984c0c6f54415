"""What may go when room is needed, and what never does."""

import errno
import json
from pathlib import Path

import pytest

from labdrive.model.errors import StoreError
from labdrive.store.lock import held
from labdrive.store.retention import remove, runs_by_age, to_go


@pytest.fixture
def root(tmp_path):
    """Eight runs of two recipes, 100 kB each, oldest first; the last of a.yaml failed."""
    states = ["done", "failed", "done", "done", "done", "interrupted", "done", "failed"]
    recipes = ["a", "a", "b", "a", "a", "a", "b", "a"]
    for i, (status, recipe) in enumerate(zip(states, recipes, strict=True)):
        folder = tmp_path / f"2026010{i}T000000Z-optimize-0000"
        folder.mkdir()
        info = {"status": status, "recipe": f"{recipe}.yaml", "bench": "bench.yaml"}
        (folder / "run.json").write_text(json.dumps(info))
        (folder / "data").write_bytes(bytes(100_000))
    return tmp_path


def gone(root, budget=None, keep=None):
    return [int(run.path.name[7]) for run in to_go(runs_by_age(root), budget, keep)]


def test_the_oldest_go_first_but_no_last_good_run_and_none_to_be_gone_on_with(root):
    assert gone(root, keep=5) == [0, 1, 2]
    assert gone(root, keep=0) == [0, 1, 2, 3, 7]
    assert gone(root, budget=650_000) == [0, 1]
    assert gone(root, budget=10_000_000) == []


def test_a_run_at_work_stays(root):
    first = next(iter(to_go(runs_by_age(root), None, 0)))
    assert remove(first)
    assert not first.path.exists()
    second = next(iter(to_go(runs_by_age(root), None, 0)))
    with held(second.path / ".lock", "test"):
        assert not remove(second)
    assert second.path.exists()


def test_a_run_that_nobody_is_at_work_on_any_more_was_cut_short(root):
    for number in (1, 3):
        folder = root / f"2026010{number}T000000Z-optimize-0000"
        info = {"status": "running", "recipe": "a.yaml", "bench": "bench.yaml"}
        (folder / "run.json").write_text(json.dumps(info))
    with held(root / "20260101T000000Z-optimize-0000" / ".lock", "test"):
        why = {int(run.path.name[7]): run.why for run in runs_by_age(root)}
    assert why[1] == "it is at work"
    assert why[3] == "cut short: labdrive resume can go on with it"
    assert why[5] == "interrupted: labdrive resume can go on with it"


def test_a_file_that_goes_while_it_is_measured_does_not_count(root, monkeypatch):
    """A run at work removes each spool when its recording is whole."""
    is_file = Path.is_file

    def and_gone(path):
        found = is_file(path)
        if path.name == "data":
            path.unlink(missing_ok=True)
        return found

    monkeypatch.setattr(Path, "is_file", and_gone)
    assert all(run.size < 1000 for run in runs_by_age(root))


def test_a_full_disk_keeps_no_run_from_being_removed(root, monkeypatch):
    monkeypatch.setattr(Path, "write_text", no_space)
    run = next(iter(to_go(runs_by_age(root), None, 0)))
    assert remove(run)
    assert not run.path.exists()


def no_space(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_run_that_cannot_be_removed_is_an_error(root, monkeypatch):
    monkeypatch.setattr("shutil.rmtree", no_space)
    with pytest.raises(StoreError, match=r"cannot remove .*: No space"):
        remove(next(iter(to_go(runs_by_age(root), None, 0))))
