"""Recordings come back bit for bit, anybody can read them, and damage is noticed."""

import dataclasses
import hashlib

import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.model.errors import StoreError
from labdrive.model.motion import Direction
from labdrive.model.recording import Recording, Sampling
from labdrive.store.recordings import read_recording, write_recording

ANY_DOUBLE = st.floats(allow_nan=True, allow_infinity=True, width=64)
NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{0,12}", fullmatch=True).filter(
    lambda name: name not in {"phase", "time", "sample"}
)


@st.composite
def any_recordings(draw):
    column = arrays(np.float64, draw(st.integers(0, 40)), elements=ANY_DOUBLE)
    names = draw(st.lists(NAMES, max_size=4, unique=True))
    return Recording(
        number=draw(st.integers(1, 12_345)),
        label=draw(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)),
        phase=draw(column),
        time=draw(column),
        readings={name: draw(column) for name in names},
        units={name: draw(st.sampled_from(["m", "rad", "N", "°C", "1"])) for name in names},
        samples_per_period=draw(st.integers(1, 10**9)),
        periods=draw(st.integers(0, 10**9)),
        direction=draw(st.sampled_from(Direction)),
        sampling=draw(st.sampled_from(Sampling)),
    )


def bits(column):
    return column.dtype, column.tobytes()


@given(any_recordings())
def test_a_recording_comes_back_bit_for_bit(tmp_path_factory, recording):
    folder = tmp_path_factory.mktemp("recordings")
    stored = write_recording(folder, recording)
    again = read_recording(folder / f"{recording.number:04d}.h5", stored.sha256)
    assert stored.file == f"{folder.name}/{recording.number:04d}.h5"
    columns = {"phase", "time", "readings"}
    for field in {f.name for f in dataclasses.fields(Recording)} - columns:
        assert getattr(again, field) == getattr(recording, field)
        assert type(getattr(again, field)) is type(getattr(recording, field))
    assert bits(again.phase) == bits(recording.phase)
    assert bits(again.time) == bits(recording.time)
    assert again.readings.keys() == recording.readings.keys()
    for name, column in recording.readings.items():
        assert bits(again.readings[name]) == bits(column)


def test_xarray_reads_it_without_options(tmp_path, make_recording):
    recording = make_recording(number=7, direction=Direction.BACKWARD)
    write_recording(tmp_path, recording)
    with xarray.open_dataset(tmp_path / "0007.h5") as data:
        assert dict(data.sizes) == {"sample": 65}
        assert set(data.variables) == {"phase", "time", "interferometer", "force"}
        units = {name: data[name].attrs["units"] for name in data.variables}
        assert units == {"phase": "rad", "time": "s", "interferometer": "m", "force": "N"}
        assert all(data[name].attrs["long_name"] for name in data.variables)
        assert data.attrs["recording"] == 7
        assert data.attrs["label"] == "iteration 0"
        assert data.attrs["direction"] == "backward"
        assert data.attrs["sampling"] == "triggered"
        assert (data.attrs["samples_per_period"], data.attrs["periods"]) == (16, 4)
        np.testing.assert_array_equal(data["time"].values, recording.time)
        np.testing.assert_array_equal(data["force"].values, recording.readings["force"])


def test_one_recording_makes_one_file_whose_hash_can_be_foretold(tmp_path, make_recording):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    stored = write_recording(tmp_path / "a", make_recording())
    again = write_recording(tmp_path / "b", make_recording())
    assert stored.sha256 == again.sha256
    assert stored.sha256 == hashlib.sha256((tmp_path / "a/0001.h5").read_bytes()).hexdigest()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["0001.h5"]


@pytest.mark.parametrize("name", ["phase", "time", "sample"])
def test_a_sensor_cannot_take_the_name_of_an_axis(tmp_path, make_recording, name):
    recording = make_recording(readings={name: np.zeros(65)}, units={name: "m"})
    with pytest.raises(StoreError, match=f"cannot be called '{name}'; rename it in the bench"):
        write_recording(tmp_path, recording)
    assert list(tmp_path.iterdir()) == []


def test_a_flipped_bit_does_not_pass_the_hash(tmp_path, make_recording):
    stored = write_recording(tmp_path, make_recording())
    path = tmp_path / "0001.h5"
    damaged = bytearray(path.read_bytes())
    damaged[-100] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(StoreError, match=r"0001\.h5 is damaged"):
        read_recording(path, stored.sha256)


def test_every_truncation_is_noticed_even_without_the_hash(tmp_path, make_recording):
    write_recording(tmp_path, make_recording())
    path = tmp_path / "0001.h5"
    whole = path.read_bytes()
    for length in (0, 1, 8, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(StoreError, match=r"cannot read the recording .*0001\.h5"):
            read_recording(path)


def test_bytes_gone_wrong_never_escape_as_another_error(tmp_path, make_recording):
    write_recording(tmp_path, make_recording())
    path = tmp_path / "0001.h5"
    whole, random, refused = path.read_bytes(), np.random.default_rng(1), 0
    for _ in range(200):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 30):
            damaged[place] = random.integers(0, 256)
        path.write_bytes(damaged)
        try:
            read_recording(path)
        except StoreError:
            refused += 1
    assert refused > 100


def test_what_is_no_recording_is_refused_by_name(tmp_path):
    with pytest.raises(StoreError, match=r"cannot read the recording .*none\.h5"):
        read_recording(tmp_path / "none.h5")
    xarray.Dataset({"phase": ("sample", [0.0])}).to_netcdf(tmp_path / "other.h5", engine="h5netcdf")
    with pytest.raises(StoreError, match=r"cannot read the recording .*other\.h5"):
        read_recording(tmp_path / "other.h5")
