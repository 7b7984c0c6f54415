"""What a killed process, a full disk and a failing one leave behind."""

import errno
import os
import resource
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from labdrive.model.errors import StoreError
from labdrive.store.durable import write_text
from labdrive.store.journal import Journal, read_journal
from labdrive.store.patient_file import patient
from labdrive.store.recordings import read_recording, write_recording


@contextmanager
def files_no_larger_than(size):
    """Make each write beyond `size` bytes of a file fail, as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def killed_after(run, seconds):
    """Run a writer, kill it that long after its first recording; return the last it spoke of."""
    command = [sys.executable, str(Path(__file__).with_name("writer.py")), str(run)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
        first = writer.stdout.readline()
        time.sleep(seconds)
        writer.kill()
        said = [first, *writer.stdout.read().splitlines(keepends=True)]
    return max(int(line) for line in said if line.endswith("\n"))


@pytest.mark.parametrize("instant", [0.0, 0.021, 0.064, 0.133])
def test_a_killed_process_loses_nothing_that_the_journal_names(tmp_path, instant):
    (tmp_path / "recordings").mkdir()
    said = killed_after(tmp_path, instant)
    entries = read_journal(tmp_path / "journal.jsonl")
    recorded = [entry for entry in entries if entry["event"] == "recorded"]
    assert len(recorded) >= said >= 1
    for entry in recorded:
        recording = read_recording(tmp_path / entry["file"], entry["sha256"])
        assert recording.readings["s"][-1] == recording.number == entry["number"]
    named = {path.name for path in (tmp_path / "recordings").glob("*.h5")}
    intended = {f"{e['number']:04d}.h5" for e in entries if e["event"] == "recording_intended"}
    assert named <= intended
    for name in named:
        read_recording(tmp_path / "recordings" / name)


@pytest.mark.parametrize("share", [0, 0.01, 0.3, 0.5, 0.9, 0.999])
def test_a_full_disk_leaves_no_half_recording(tmp_path, make_recording, share, capfd):
    whole = tmp_path / "whole"
    whole.mkdir()
    write_recording(whole, make_recording(samples=3000))
    room = int(share * (whole / "0001.h5").stat().st_size)
    folder = tmp_path / "recordings"
    folder.mkdir()
    refusal = pytest.raises(StoreError, match=r"cannot write .*recordings/0001\.h5: File too large")
    with files_no_larger_than(room), refusal:
        write_recording(folder, make_recording(samples=3000))
    assert list(folder.iterdir()) == []
    assert capfd.readouterr().err == ""
    write_recording(folder, make_recording(samples=3000))
    assert (folder / "0001.h5").read_bytes() == (whole / "0001.h5").read_bytes()


def test_a_full_disk_leaves_the_journal_as_it_was(tmp_path):
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.append("recorded", number=1)
        before = path.read_bytes()
        for room in range(len(before), 2 * len(before), 7):
            with files_no_larger_than(room), pytest.raises(StoreError, match="File too large"):
                journal.append("recorded", number=2)
            assert path.read_bytes() == before
        journal.append("recorded", number=3)
    assert [(entry["seq"], entry["number"]) for entry in read_journal(path)] == [(1, 1), (2, 3)]


def test_a_full_disk_leaves_the_old_file(tmp_path):
    path = tmp_path / "run.json"
    write_text(path, "old")
    with files_no_larger_than(10), pytest.raises(StoreError, match="File too large"):
        write_text(path, "new" * 100)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def failing_fsync(_handle):
    raise OSError(errno.EIO, os.strerror(errno.EIO))


def test_a_disk_that_does_not_take_it_gives_the_file_no_name(tmp_path, make_recording, monkeypatch):
    monkeypatch.setattr(os, "fsync", failing_fsync)
    with pytest.raises(StoreError, match=r"0001\.h5: Input/output error; the disk fails"):
        write_recording(tmp_path, make_recording())
    assert list(tmp_path.iterdir()) == []


def test_an_entry_that_the_disk_does_not_take_is_not_there(tmp_path, monkeypatch):
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        monkeypatch.setattr(os, "fsync", failing_fsync)
        with pytest.raises(StoreError, match=r"journal\.jsonl: Input/output error"):
            journal.append("recorded", number=1)
    assert read_journal(path) == []


def test_the_first_failure_is_told_when_the_block_ends():
    said = []

    def write_twice():
        with patient(Path("/dev/full")) as file:
            said.extend([file.write(b"lost"), file.write(b"lost as well")])

    with pytest.raises(OSError, match="No space left on device"):
        write_twice()
    assert said == [4, 12]
