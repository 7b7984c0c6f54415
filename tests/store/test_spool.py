"""Spools: what a recording has read so far."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import StoreError
from labdrive.store.spool import Spool, read_spool, set_aside


def columns(count, start=0):
    time = np.arange(start, start + count, dtype=np.float64)
    return {"time": time, "x": np.sin(time)}


def spooled(path, *chunks):
    """Return the bytes of a spool while it is open."""
    with Spool(path, "test") as spool:
        start = 0
        for count in chunks:
            spool.add(columns(count, start))
            start += count
        return path.read_bytes()


def test_each_chunk_is_in_the_file_at_once_and_the_file_is_gone_in_the_end(tmp_path):
    path = tmp_path / "0001.spool"
    data = spooled(path, 3, 5)
    assert not path.exists()
    path.write_bytes(data)
    found = read_spool(path)
    for name, values in columns(8).items():
        np.testing.assert_array_equal(found[name], values)


def test_it_stays_where_the_recording_failed(tmp_path):
    path = tmp_path / "0001.spool"
    with suppress(RuntimeError), Spool(path, "test") as spool:
        spool.add(columns(4))
        raise RuntimeError
    assert len(read_spool(path)["time"]) == 4


@given(torn=st.integers(0, 200))
def test_a_torn_end_costs_no_more_than_the_last_row(tmp_path_factory, torn):
    path = tmp_path_factory.mktemp("spool") / "0001.spool"
    data = spooled(path, 20)
    path.write_bytes(data[: len(data) - torn])
    found = read_spool(path)
    assert len(found["time"]) == 20 - -(-torn // 16)
    np.testing.assert_array_equal(found["x"], np.sin(found["time"]))


def test_what_a_kill_left_gets_a_name_of_its_own(tmp_path):
    for attempt in (1, 2):
        (tmp_path / "0003.spool").write_bytes(b"x")
        assert set_aside(tmp_path, 3).endswith(f"0003.part-{attempt}.spool")
    assert set_aside(tmp_path, 3) is None


def test_something_else_is_no_spool(tmp_path):
    path = tmp_path / "0001.spool"
    path.write_bytes(b"\x00\x01")
    with pytest.raises(StoreError, match=r"0001\.spool"):
        read_spool(path)
