"""The journal keeps what was said to it, and tells a torn end from damage."""

import json
import logging
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.model.errors import StoreError
from labdrive.store.journal import Journal, read_journal

FIELDS = st.dictionaries(
    st.text(st.characters(codec="utf-8"), max_size=8).filter(
        lambda name: name not in {"seq", "time", "event", "self"}
    ),
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8"), max_size=8),
    max_size=4,
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal.jsonl"


@pytest.fixture
def three(path):
    with Journal(path) as journal:
        for number in (1, 2, 3):
            journal.append("recorded", number=number)
    return path


@given(st.lists(FIELDS, max_size=5))
def test_entries_come_back_as_they_were_given(tmp_path_factory, entries):
    path = tmp_path_factory.mktemp("run") / "journal.jsonl"
    with Journal(path) as journal:
        for fields in entries:
            journal.append("noted", **fields)
    found = read_journal(path)
    assert [entry.pop("seq") for entry in found] == list(range(1, len(entries) + 1))
    assert all(datetime.fromisoformat(entry.pop("time")).tzinfo == UTC for entry in found)
    assert found == [{"event": "noted", **fields} for fields in entries]


def test_an_entry_can_be_read_as_soon_as_append_returns(path):
    with Journal(path) as journal:
        journal.append("recorded", number=1, sha256="ab")
        (entry,) = read_journal(path)
    assert (entry["seq"], entry["event"], entry["number"]) == (1, "recorded", 1)
    assert path.read_bytes().count(b"\n") == 1


def test_it_goes_on_counting_when_opened_again(three):
    with Journal(three) as journal:
        journal.append("run_done")
    assert [entry["seq"] for entry in read_journal(three)] == [1, 2, 3, 4]


def test_every_torn_end_is_dropped_reported_and_written_over(three, caplog):
    whole = three.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for length in range(last + 1, len(whole)):
        three.write_bytes(whole[:length])
        with caplog.at_level(logging.WARNING):
            assert [entry["number"] for entry in read_journal(three)] == [1, 2]
        assert f"torn last line of {length - last} bytes" in caplog.text
        with Journal(three) as journal:
            journal.append("recorded", number=9)
        assert [entry["number"] for entry in read_journal(three)] == [1, 2, 9]
        caplog.clear()


def test_zeros_that_a_power_cut_leaves_at_the_end_are_a_torn_end(three):
    whole = three.read_bytes()
    start = whole.rstrip(b"\n").rfind(b"\n") + 1
    three.write_bytes(whole[:start] + bytes(20) + whole[start + 20 :])
    assert [entry["number"] for entry in read_journal(three)] == [1, 2]
    three.write_bytes(whole + bytes(4096))
    with Journal(three) as journal:
        journal.append("recorded", number=4)
    assert [entry["number"] for entry in read_journal(three)] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    "damage",
    [b"", b"{", b"[]", b"3", b"\xff\xfe", b"{}", b'{"seq": 3}', b'{"seq": "2"}', bytes(10)],
)
def test_damage_elsewhere_names_the_line_and_loses_nothing(three, damage):
    lines = three.read_bytes().splitlines()
    damaged = b"\n".join([lines[0], damage, lines[2], b""])
    three.write_bytes(damaged)
    with pytest.raises(StoreError, match=r"journal\.jsonl:2: damaged"):
        read_journal(three)
    with pytest.raises(StoreError, match=r"journal\.jsonl:2: damaged"):
        Journal(three)
    assert three.read_bytes() == damaged


def test_nothing_that_is_not_json_gets_in(path):
    with Journal(path) as journal:
        with pytest.raises(ValueError, match="not JSON compliant"):
            journal.append("noted", value=float("nan"))
        journal.append("noted", value=1.0)
    assert [json.loads(line)["seq"] for line in path.read_text().splitlines()] == [1]


def test_a_journal_that_is_not_there_is_named(path):
    with pytest.raises(StoreError, match=r"cannot read .*journal\.jsonl: No such file"):
        read_journal(path)
    with pytest.raises(StoreError, match=r"cannot write .*nowhere"):
        Journal(path.parent / "nowhere" / "journal.jsonl")
