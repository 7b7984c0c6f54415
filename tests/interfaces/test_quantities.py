import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, TypeAdapter, ValidationError

from labdrive.interfaces import quantities
from labdrive.interfaces.quantities import (
    AngleOrLength,
    AnyQuantity,
    InputFile,
    Length,
    Quantity,
    Voltage,
)
from labdrive.interfaces.settings import Settings

NAMED = {
    name: kind
    for name, kind in vars(quantities).items()
    if any(isinstance(mark, Quantity) for mark in getattr(kind, "__metadata__", ()))
}


class Part(Settings):
    height: Length = Field(default=5e-6, gt=0)
    ends: list[AngleOrLength] = Field(default_factory=list)
    scale: AnyQuantity | None = None
    top: Voltage | None = Field(default=None, le=48)


class Files(Settings):
    data: InputFile


def refusal(**given):
    with pytest.raises(ValidationError) as refused:
        Part.model_validate(given)
    (error,) = refused.value.errors()
    return error["msg"]


def test_every_kind_of_the_brief_is_there():
    assert len(NAMED) == 19


@pytest.mark.parametrize("name", NAMED)
def test_its_own_example_is_taken(name):
    (mark,) = (mark for mark in NAMED[name].__metadata__ if isinstance(mark, Quantity))
    for example in mark.example.split(" or "):
        assert TypeAdapter(NAMED[name]).validate_python(example) > 0


def test_text_becomes_si():
    part = Part(height="3 um", ends=["90 deg", "-2 mm"], scale="0.0439453125 deg", top="48 V")
    assert part.height == 3e-6
    assert part.ends == [math.pi / 2, -0.002]
    assert part.scale == AnyQuantity(math.radians(0.0439453125), "rad")
    assert part.top == 48


def test_either_dimension_remembers_which():
    assert [end.unit for end in Part(ends=["90 deg", "-2 mm"]).ends] == ["rad", "m"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"height": 5}, "a number needs a unit here, as in 5 um"),
        ({"height": 5.0}, "a number needs a unit here, as in 5 um"),
        ({"height": "5"}, "a number without a unit; write it as in 5 um"),
        ({"height": "5 V"}, "a unit like that of 5 um is due, not V"),
        ({"height": "5 M"}, "no unit M; did you mean m?; write it as in 5 um"),
        ({"height": True}, "a number with a unit is due, as in 5 um"),
        ({"height": None}, "a number with a unit is due, as in 5 um"),
        ({"height": "nan m"}, "not a number with a unit, as in 5 um"),
        ({"height": "-5 um"}, "Input should be greater than 0"),
        ({"top": "49 V"}, "Input should be less than or equal to 48"),
        ({"ends": ["5 s"]}, "a unit like that of 5 um or 90 deg is due, not s"),
        ({"scale": 5}, "a number needs a unit here, as in 0.044 deg, or 3 1 for a pure number"),
    ],
)
def test_what_is_due_is_said(given, message):
    assert refusal(**given) == message


@given(st.floats(min_value=1e-300, max_value=1e300), st.sampled_from(["m", "rad"]))
def test_settings_dump_to_text_that_reads_back(value, unit):
    part = Part(height=f"{value!r} m", ends=[f"{value!r} {unit}"], scale=f"{value!r} N/m")
    dumped = part.model_dump(mode="json")
    assert Part.model_validate(dumped) == part
    assert Part.model_validate(dumped).ends[0].unit == unit


def test_defaults_are_si_and_dump_as_text():
    expected = {"height": "5 um", "ends": [], "scale": None, "top": None}
    assert Part().height == 5e-6
    assert Part().model_dump(mode="json") == expected


@pytest.mark.parametrize("name", NAMED)
def test_the_schema_takes_what_validation_takes(name):
    schema = TypeAdapter(NAMED[name]).json_schema()
    assert schema["type"] == "string"
    for text in schema["examples"]:
        assert re.search(schema["pattern"], text)
    assert not re.search(schema["pattern"], "5")


@pytest.mark.parametrize(
    ("text", "fits"),
    [("5 um", True), ("5m", True), ("-1e-3 µm", True), ("5 V", False), ("5 min", False)],
)
def test_the_schema_knows_the_dimension(text, fits):
    pattern = TypeAdapter(Length).json_schema()["pattern"]
    assert bool(re.search(pattern, text)) is fits


def missing(folder, name):
    with pytest.raises(ValidationError) as refused:
        Files.model_validate({"data": name}, context={"folder": folder})
    return refused.value.errors()[0]["msg"]


def test_a_file_is_found_beside_the_one_that_names_it(tmp_path):
    (tmp_path / "data.csv").touch()
    files = Files.model_validate({"data": "data.csv"}, context={"folder": tmp_path})
    assert files.data == tmp_path / "data.csv"
    assert files.model_dump(mode="json") == {"data": str(tmp_path / "data.csv")}


@pytest.mark.parametrize("name", ["data/a.csv", "data/sub/a.csv", "data/sub/deep/a.csv"])
def test_a_missing_file_points_to_the_readme_nearby(tmp_path, name):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "README.md").touch()
    readme = tmp_path / "data" / "README.md"
    assert missing(tmp_path, name) == (
        f"there is no file {tmp_path / name}; see {readme} for where to get it"
    )


def test_a_missing_file_with_no_readme_nearby(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "README.md").touch()
    assert missing(tmp_path, "data/a.csv") == f"there is no file {tmp_path / 'data/a.csv'}"
    assert missing(tmp_path, "data") == f"{tmp_path / 'data'} is a folder, not a file"


@pytest.mark.parametrize("name", ["", 3, None, "a\0b"])
def test_a_file_needs_a_name(tmp_path, name):
    assert missing(tmp_path, name) == "the name of a file is due"
