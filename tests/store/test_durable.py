"""Files are written whole or not at all."""

import json
import os

import pytest

from labdrive.model.errors import StoreError
from labdrive.store.durable import make_folder, write_json, write_text, written_aside


def test_what_is_written_is_there_alone(tmp_path):
    write_text(tmp_path / "a.txt", "µ\n")
    write_json(tmp_path / "b.json", {"pv": 1e-9})
    assert (tmp_path / "a.txt").read_bytes() == "µ\n".encode()
    assert json.loads((tmp_path / "b.json").read_text()) == {"pv": 1e-9}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.json"]


def test_nan_is_no_json(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "b.json", {"pv": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_a_failure_half_way_leaves_the_old_file(tmp_path):
    path = tmp_path / "run.json"
    write_text(path, "old")

    def fail_half_way():
        with written_aside(path) as aside:
            aside.write_text("ne")
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_reaches_the_disk_before_its_name_and_its_name_before_the_end(
    tmp_path, monkeypatch
):
    order, fsync, replace = [], os.fsync, os.replace

    def noted_fsync(handle):
        order.append(("fsync", os.fstat(handle).st_ino))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(os, "replace", lambda a, b: (order.append(("name", str(b))), replace(a, b)))
    write_text(tmp_path / "a.txt", "text")
    file, folder = (tmp_path / "a.txt").stat().st_ino, tmp_path.stat().st_ino
    named = ("name", str(tmp_path / "a.txt"))
    assert order == [("fsync", file), named, ("fsync", folder)]


def test_a_folder_that_is_a_file_is_named_with_the_cure(tmp_path):
    (tmp_path / "runs").write_text("")
    with pytest.raises(StoreError, match=r"cannot write .*a\.txt: Not a directory; part of the"):
        write_text(tmp_path / "runs" / "a.txt", "text")
    with pytest.raises(StoreError, match=r"cannot write .*new: Not a directory; part of the"):
        make_folder(tmp_path / "runs" / "new")


def test_folders_are_made_with_those_above_but_never_twice(tmp_path):
    make_folder(tmp_path / "a" / "b" / "c")
    assert (tmp_path / "a" / "b" / "c").is_dir()
    with pytest.raises(StoreError, match=r"b: File exists; nothing is written over"):
        make_folder(tmp_path / "a" / "b")
