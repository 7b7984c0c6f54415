"""Each thing that can be wrong with a file is told with the file, the place and the cure."""

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from labdrive.interfaces.devices import Samples
from labdrive.model.errors import InputError

LOG = """\
PHD2 version 2.6
Profile = "6 inch

Frame,Time,mount,Raw
1,0.5,"Mount",1.0
2,1.0,"DROP",,"Star lost"
INFO: DITHER by 1, 2

3,1.5,"Mount",3.0
Guiding Ends

Frame,Time,mount,Raw
1,0.5,"Mount",5.0
2,1.0,"Mount",6.0
3,1.5,"Mount",7.0
"""
ROWS = {"header": "Frame,", "only": {"column": "mount", "equals": "Mount"}}


def refusal(make_device, *arguments, **settings):
    with pytest.raises(InputError) as caught:
        make_device(*arguments, **settings)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ": no header line"),
        ("\n \n", ": no header line"),
        ("X,y\n1,2\n", ":1: no column 'x' among X, y"),
        ("\n\ny\n1\n", ":3: no column 'x' among y"),
        ("x\n", ": column 'x' has 0 rows; two at least make a recording"),
        ("x\n1\n", ": column 'x' has 1 rows; two at least make a recording"),
        ("x\n1\ntwo\n", ":3: column 'x' holds no finite number here (got 'two')"),
        ("x\n1\nnan\n", ":3: column 'x' holds no finite number here (got 'nan')"),
        ("x\n1\n1e999\n", ":3: column 'x' holds no finite number here (got '1e999')"),
        ("y,x\n1,1\n\n2\n", ":4: column 'x' holds no finite number here (got '')"),
        ('y,x\n"a\nb",1\n2,-\n', ":4: column 'x' holds no finite number here (got '-')"),
        ("x\n1\n" + "9" * 200_000, ": no CSV: field larger than field limit (131072)"),
    ],
)
def test_a_csv_file_points_at_the_line(write, sensor, text, message):
    path = write(text)
    assert refusal(sensor, path) == f"{path}{message}"


def test_a_misspelt_column_is_guessed(write, sensor):
    path = write("time_s,position_counts\n1,2\n")
    assert refusal(sensor, path, column="position_count").endswith(
        "among time_s, position_counts; did you mean 'position_counts'?"
    )


def test_bom_crlf_spaces_and_quotes_do_no_harm(write, sensor):
    path = write('\ufeff"x" , y\r\n 1.5 , 0\r\n"2.5",0\r\n')
    assert sensor(path).read(Samples(np.zeros(2), np.zeros(2))).value.tolist() == [1.5, 2.5]


@pytest.mark.parametrize(("section", "values"), [(1, [1.0, 3.0]), (2, [5.0, 6.0, 7.0])])
def test_a_log_is_read_section_by_section(write, sensor, section, values):
    device = sensor(write(LOG, "log.txt"), column="Raw", section=section, **ROWS)
    instants = np.zeros(len(values))
    assert device.read(Samples(instants, instants)).value.tolist() == values


def test_a_log_tells_what_it_has_not(write, sensor):
    path = write(LOG, "log.txt")
    assert refusal(sensor, path, column="Raw", section=3, **ROWS) == (
        f"{path}: no header line that starts with 'Frame,'; section 3 of 2 was asked for"
    )
    assert refusal(sensor, path, column="Raw", header="Frames") == (
        f"{path}: no header line that starts with 'Frames'"
    )
    only = {"column": "Mount", "equals": "Mount"}
    assert refusal(sensor, path, column="Raw", header="Frame,", only=only).startswith(
        f"{path}:4: no column 'Mount' among Frame, Time, mount, Raw; did you mean 'mount'?"
    )
    assert refusal(sensor, path, column="Raw", header="Frame,") == (
        f"{path}:6: column 'Raw' holds no finite number here (got '')"
    )


@pytest.mark.parametrize("name", ["table.h5", "table.npz"])
def test_what_is_for_csv_is_refused_elsewhere(write, sensor, name):
    with pytest.raises(ValidationError, match=f"are for CSV; {name} is none"):
        sensor(write("", name), header="Frame,")
    with pytest.raises(ValidationError, match="section needs header"):
        sensor(write("x\n1\n"), section=2)


@pytest.fixture
def hdf5(tmp_path):
    path = tmp_path / "table.h5"
    with h5py.File(path, "w") as file:
        file["run/x"] = np.array([1, 2, 3], dtype="i2")
        file["run/nan"] = [0.0, np.nan, 1.0]
        file["run/image"] = np.zeros((3, 2))
        file["run/name"] = "LT40"
        file["run/names"] = ["a", "b"]
        file["run/correction"] = np.zeros(2)
    return path


def test_hdf5_columns_are_datasets_by_path(hdf5, sensor):
    for column in ("run/x", "/run/x"):
        device = sensor(hdf5, column=column)
        assert device.read(Samples(np.zeros(3), np.zeros(3))).value.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"column": "run"}, "no column 'run' among run/correction, run/image, "),
        ({"column": "run/X"}, "run/x; did you mean 'run/x'?"),
        ({"column": "run/nan"}, "column 'run/nan' holds nan in row 2 of the table"),
        ({"column": "run/image"}, "'run/image' is no column of numbers: shape (3, 2), float64"),
        ({"column": "run/name"}, "'run/name' is no column of numbers: shape (), object"),
        ({"column": "run/names"}, "'run/names' is no column of numbers: shape (2,), object"),
        (
            {"column": "run/x", "add_running_sum": "run/correction"},
            "columns differ in length: run/x 3, run/correction 2",
        ),
    ],
)
def test_an_hdf5_file_tells_what_it_has_not(hdf5, sensor, settings, message):
    told = refusal(sensor, hdf5, **settings)
    assert told.startswith(f"{hdf5}: ")
    assert message in told


def test_an_npz_file_tells_what_it_has_not(tmp_path, sensor):
    path = tmp_path / "table.npz"
    np.savez(path, x=np.array([1, "a"], dtype=object), y=np.zeros(3), b=np.array([True, False]))
    assert refusal(sensor, path, column="z") == f"{path}: no column 'z' among x, y, b"
    assert "cannot be read: Object arrays" in refusal(sensor, path, column="x")
    assert "'b' is no column of numbers: shape (2,), bool" in refusal(sensor, path, column="b")


@pytest.mark.parametrize("name", ["table.h5", "table.npz"])
@given(junk=st.binary(max_size=200))
def test_junk_is_refused_by_name(tmp_path_factory, sensor, name, junk):
    path = tmp_path_factory.mktemp("junk") / name
    path.write_bytes(junk)
    with pytest.raises(InputError, match=f"{name}: (cannot be read|is no npz archive)"):
        sensor(path)


@pytest.mark.parametrize("ending", ["h5", "npz"])
def test_damage_never_escapes_as_another_error(tmp_path, sensor, ending):
    path = tmp_path / f"table.{ending}"
    column = np.linspace(0, 1, 50)
    if ending == "h5":
        with h5py.File(path, "w") as file:
            file.create_dataset("x", data=column, compression="gzip")
    else:
        np.savez_compressed(path, x=column)
    whole, random, refused = path.read_bytes(), np.random.default_rng(3), 0
    for _ in range(150):
        damaged = bytearray(whole[: random.integers(len(whole) // 2, len(whole) + 1)])
        for place in random.integers(0, len(damaged), 10):
            damaged[place] = random.integers(0, 256)
        path.write_bytes(damaged)
        try:
            sensor(path)
        except InputError as error:
            assert f"table.{ending}" in str(error)  # noqa: PT017 not every damage is told
            refused += 1
    assert refused > 75


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"column": "still"}, "table.csv: column 'still' does not advance"),
        ({"column": "back"}, "time 'back' runs backwards after row 2 of the table; is it several"),
        ({"column": "n", "cycle": "1 count", "time": "still"}, "time 'still' stands still"),
        ({"column": "n", "cycle": "1 count", "time": "back"}, "time 'back' runs backwards after"),
        ({"column": "n", "cycle": "0 s"}, "actuators.motor.phase.cycle: must not be 0"),
        (
            {"column": "n", "cycle": "1 s", "scale": "1 count"},
            "actuators.motor.phase.scale: must have the unit of the cycle, s (got count)",
        ),
        ({"column": "m"}, ":1: no column 'm' among n, still, back"),
    ],
)
def test_phases_that_cannot_be(write, actuator, settings, message):
    path = write("n,still,back\n0,1,0\n1,1,2\n2,1,1\n")
    assert message in refusal(actuator, path, **settings)
