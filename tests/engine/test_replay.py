"""A run recomputed from its journal gives the same bits, or the step that differs."""

import json

import pytest

from labdrive.engine.replay import replay
from labdrive.engine.versions import changed_versions
from labdrive.model.errors import ReplayError, StoreError
from labdrive.store.run_folder import RunFolder


@pytest.fixture
def done(lab):
    outcome = lab.run()
    assert outcome.status == "done"
    lab.plant.calls.clear()
    return RunFolder(outcome.folder)


def edit(path, change):
    path.write_text(change(path.read_text()))


def test_a_replay_gives_the_same_result_and_moves_nothing(lab, done):
    before = {p: p.read_bytes() for p in done.path.rglob("*") if p.is_file()}
    result = replay(done, lab.host.plugins)
    assert json.loads(json.dumps(result)) == json.loads((done.path / "result.json").read_text())
    assert lab.plant.calls == []
    assert {p: p.read_bytes() for p in done.path.rglob("*") if p.is_file()} == before


def test_another_optimizer_differs_at_the_first_table_it_would_have_changed(lab, done):
    edit(done.path / "recipe.yaml", lambda text: text.replace("harmonics: null", "harmonics: 2"))
    with pytest.raises(ReplayError, match=r"recording 2 \(iteration 1\) differs.*table_sha256"):
        replay(done, lab.host.plugins)


def test_a_result_that_was_changed_is_told_with_its_place(lab, done):
    edit(done.path / "result.json", lambda text: text.replace('"converged"', '"noise_floor"'))
    edit(
        done.path / "result.json",
        lambda text: text.replace('"best_iteration": 1', '"best_iteration": 0'),
    )
    edit(done.path / "result.json", lambda text: text.replace('"sensor": "probe"', '"sensor": "x"'))
    with pytest.raises(ReplayError, match=r"the result differs at sensor: the run had x"):
        replay(done, lab.host.plugins)


def test_a_damaged_recording_is_named(lab, done):
    path = done.path / "recordings" / "0002.h5"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))
    with pytest.raises(StoreError, match=r"0002\.h5"):
        replay(done, lab.host.plugins)


def test_a_torn_result_is_named(lab, done):
    edit(done.path / "result.json", lambda text: text[: len(text) // 2])
    with pytest.raises(StoreError, match=r"cannot read .*result\.json"):
        replay(done, lab.host.plugins)


def test_a_run_that_was_cut_short_says_which_recording_is_missing(lab, done):
    lines = (done.path / "journal.jsonl").read_text().splitlines(keepends=True)
    (done.path / "journal.jsonl").write_text("".join(lines[:4]))
    with pytest.raises(ReplayError, match=r"recording 2 \(iteration 1\) was never finished"):
        replay(done, lab.host.plugins)


def test_a_changed_version_is_said(lab, done):
    info = done.read_run()
    assert list(changed_versions(info, lab.host.plugins)) == []
    info["versions"]["numpy"] = "1.0"
    info["versions"]["plugins"]["sensors.lost"] = "thermo 1.2"
    said = list(changed_versions(info, lab.host.plugins))
    assert said[0].startswith("numpy was 1.0, is ")
    assert said[1] == "plugin sensors.lost was of thermo 1.2, is of nobody"
