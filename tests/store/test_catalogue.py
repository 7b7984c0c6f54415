"""The index of run folders: always what the folders say."""

import json
import os
import threading

import pytest

from labdrive.store.catalogue import FILE, catalogued, reindex
from labdrive.store.run_folder import list_runs


@pytest.fixture
def root(tmp_path):
    for i in range(5):
        write(tmp_path, i)
    return tmp_path


def write(root, number, status="done"):
    folder = root / f"20260101T{number:06d}Z-optimize-0000"
    folder.mkdir(exist_ok=True)
    path = folder / "run.json"
    path.write_text(json.dumps({"status": status, "title": f"run {number}"}))
    os.utime(path, ns=(number, number + (status == "failed")))
    return folder


def test_it_says_what_the_folders_say_as_they_come_change_and_go(root):
    assert catalogued(root) == list_runs(root)
    write(root, 7)
    write(root, 2, status="failed")
    for file in (gone := write(root, 3)).iterdir():
        file.unlink()
    gone.rmdir()
    assert catalogued(root) == list_runs(root)
    assert [info["title"] for info in catalogued(root)] == [f"run {i}" for i in (7, 4, 2, 1, 0)]


def test_a_damaged_run_is_in_it_and_other_folders_are_not(root):
    (root / "notes").mkdir()
    (root / "20260101T000009Z-optimize-0000").mkdir()
    (root / "20260101T000009Z-optimize-0000" / "run.json").write_text("{")
    assert catalogued(root) == list_runs(root)
    assert catalogued(root)[0]["status"] == "unreadable"


def test_a_damaged_index_is_passed_over_and_built_anew(root):
    (root / FILE).write_text("no database" * 1000)
    assert catalogued(root) == list_runs(root)
    assert reindex(root) == 5
    assert catalogued(root) == list_runs(root)


def test_several_readers_at_once_all_see_everything(root):
    found = []
    readers = [threading.Thread(target=lambda: found.append(catalogued(root))) for _ in range(8)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    assert found == [list_runs(root)] * 8


def test_nowhere_there_are_no_runs(tmp_path):
    assert catalogued(tmp_path / "nowhere") == []
