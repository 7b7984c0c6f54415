"""Run folders: names of the contract, nothing used twice, tables with every digit."""

import json
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.model.errors import InputError, StoreError
from labdrive.store.run_folder import RunFolder, list_runs

NOW = datetime(2026, 11, 20, 19, 45, 12, tzinfo=UTC)


def create(root, ending="3f9a", now=NOW):
    return RunFolder.create(root, "optimize", now=now, token=ending)


@pytest.fixture
def folder(tmp_path):
    return create(tmp_path / "runs")


def test_it_is_named_by_time_kind_and_token(folder, tmp_path):
    assert folder.path == tmp_path / "runs" / "20261120T194512Z-optimize-3f9a"
    assert sorted(path.name for path in folder.path.iterdir()) == ["recordings", "tables"]


def test_no_folder_is_used_twice(folder, tmp_path):
    with pytest.raises(StoreError, match="3f9a: File exists"):
        create(tmp_path / "runs")


def test_run_and_result_come_back(folder):
    folder.write_run({"id": "a", "status": "running"})
    folder.write_run({"id": "a", "status": "done"})
    folder.write_result({"kind": "optimize"})
    assert RunFolder.open(folder.path).read_run() == {"id": "a", "status": "done"}
    assert json.loads((folder.path / "result.json").read_text()) == {"kind": "optimize"}


def test_what_is_no_run_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"is not a run folder: it holds no run\.json"):
        RunFolder.open(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00"])
def test_a_damaged_run_is_named(folder, text):
    (folder.path / "run.json").write_text(text)
    with pytest.raises(StoreError, match=r"cannot read .*run\.json"):
        RunFolder.open(folder.path).read_run()


@given(st.integers(0, 20).flatmap(lambda n: arrays(np.float64, (2, n))))
def test_tables_keep_every_digit(tmp_path_factory, values):
    folder = create(tmp_path_factory.mktemp("runs"))
    folder.write_table("map", {"phase_rad": values[0], "psi_rad": values[1]})
    again = folder.read_table("map")
    assert list(again) == ["phase_rad", "psi_rad"]
    np.testing.assert_array_equal(np.array(list(again.values())), values)


def test_a_table_is_plain_csv(folder):
    folder.write_table("psi", {"phase_rad": np.array([0.0, 0.1]), "U0_V": np.array([24.0, 1e-9])})
    text = (folder.path / "tables" / "psi.csv").read_text()
    assert text == "phase_rad,U0_V\n0.0,24.0\n0.1,1e-09\n"


@pytest.mark.parametrize("text", ["", "a,b\n1\n", "a,b\n1,2\n3\n", "a\nx\n", "a,b\n1,2,3\n4,5,6\n"])
def test_a_damaged_table_is_named(folder, text):
    (folder.path / "tables" / "psi.csv").write_text(text)
    with pytest.raises(StoreError, match=r"cannot read .*psi\.csv"):
        folder.read_table("psi")


def test_runs_are_listed_newest_first_whatever_lies_among_them(tmp_path):
    for hour, ending in ((9, "aaaa"), (11, "bbbb"), (10, "cccc")):
        run = create(tmp_path, ending, NOW.replace(hour=hour))
        run.write_run({"status": "done", "title": ending})
    (tmp_path / "20261120T120000Z-optimize-dddd").mkdir()
    (tmp_path / "notes.txt").write_text("mine")
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "run.json").write_text('{"speed": 3}')
    (tmp_path / "20261120T094512Z-optimize-aaaa" / "run.json").write_text("{")
    runs = list_runs(tmp_path)
    assert [run["id"][-4:] for run in runs] == ["bbbb", "cccc", "aaaa"]
    assert [run["status"] for run in runs] == ["done", "done", "unreadable"]
    assert "cannot read" in runs[-1]["title"]


def test_no_folder_holds_no_runs(tmp_path):
    assert list_runs(tmp_path / "none") == []
