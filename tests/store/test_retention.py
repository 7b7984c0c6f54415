"""What may go when room is needed, and what never does."""

import json

import pytest

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
