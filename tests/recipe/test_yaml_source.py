from contextlib import suppress

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from labdrive.recipe.yaml_source import compose, read
from labdrive.recipe.yaml_text import yaml_text

NO_TAGS = "tags are not taken: recipes and benches hold plain data"


def lines(source):
    return [str(problem) for problem in source.problems]


def test_data_and_places():
    source = compose("a: 1\nb:\n  - {c: on}\n  - 12:30\n", "f")
    assert source.data == {"a": 1, "b": [{"c": "on"}, "12:30"]}
    place = source.place(("b", 0, "c"))
    assert (place.line, place.column) == (3, 9)
    assert source.place(("b", 0, "c"), key=True).column == 6
    assert source.place(("b", 1)).line == 4
    assert source.place(("b", "nothing")).line == 2


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("a: 1\nb: 2\na: 3", ["f:3:1: a: given twice, first on line 1"]),
        ("a: {b: 1, b: 2}", ["f:1:11: a.b: given twice, first on line 1"]),
        ("a: .nan", ["f:1:4: a: a number must be finite (got .nan)"]),
        (
            "a: [1, 1e999]\nb: .inf",
            [
                "f:1:8: a.1: too large or too small for a double (got 1e999)",
                "f:2:4: b: a number must be finite (got .inf)",
            ],
        ),
        (
            "a: !!python/object/apply:os.system [ls]",
            [f"f:1:4: a: {NO_TAGS} (got tag:yaml.org,2002:python/object/apply:os.system)"],
        ),
        (
            "a: !!str 5",
            [f"f:1:4: a: {NO_TAGS} (got tag:yaml.org,2002:str)"],
        ),
        ("a: !own!x 5", [f"f:1:4: {NO_TAGS}"]),
        ("1: a", ["f:1:1: a field's name must be text; put it in quotes (got 1)"]),
        ("true: a", ["f:1:1: a field's name must be text; put it in quotes (got true)"]),
        ("? [a]\n: b", ["f:1:3: a field's name must be text; put it in quotes (got ?)"]),
        ("a: 1\n---\nb: 2", ["f:2:1: a second document begins; a file holds one"]),
        ("a:\n\tb: 1", ["f:2:1: a tab; use spaces"]),
        ("a: 1 #\tx", ["f:1:7: a tab; use spaces"]),
        ("a: &x [*x]", ["f:1:8: a.0: no value above is marked &x"]),
        ("a: *x", ["f:1:4: a: no value above is marked &x"]),
        ("a: &x 1\nb: &x 2", ["f:2:4: b: &x already marks another value"]),
        (
            "a: b: c",
            ["f:1:5: a ':' is out of place; quote the text or mend the indentation"],
        ),
        ("a: 1\nb", ["f:2:2: a ':' is missing after a field's name"]),
        ("a: {b: 1\nc: 2", ["f:2:2: a ',' or '}' is missing"]),
        ("a: [1, 2", ["f:1:9: a ',' or ']' is missing"]),
        ("a: ]", ["f:1:4: a value is due here"]),
        ("a: 'x", ["f:1:6: a quote is not closed"]),
        ("a: @x", ["f:1:4: this character cannot begin a value; quote the text"]),
        ("a: - b", ["f:1:4: a list cannot begin here; put it on a line of its own"]),
        ('a: "\\q"', ["f:1:6: in double quotes \\ begins an escape; use single quotes"]),
        ('a: "\\ud800"', ["f:1:4: a: half a surrogate pair is no text"]),
        ("a: \x07", ["f:1:4: character U+0007 cannot be in a YAML file"]),
        ("[" * 60 + "]" * 60, ["f:1:42: nested more than 40 deep"]),
    ],
)
def test_what_is_refused_and_where(text, problems):
    assert lines(compose(text, "f")) == problems


def test_aliases_share_plain_values():
    source = compose("a: &x {b: [1]}\nc: *x\nd: [*x, *x]", "f")
    assert source.data == {"a": {"b": [1]}, "c": {"b": [1]}, "d": [{"b": [1]}, {"b": [1]}]}
    assert source.data["c"] is not source.data["a"]
    assert source.place(("d", 1, "b", 0)).line == 1
    assert not source.problems


def test_an_alias_bomb_is_defused():
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12)
    )
    (problem,) = compose(bomb, "f").problems
    assert problem.message == "more than 20000 values once aliases are expanded"


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n"])
def test_an_empty_file_is_an_empty_mapping_or_null(text):
    source = compose(text, "f")
    assert not source.data
    assert source.whole


def test_files_must_be_there_and_be_utf_8(tmp_path):
    absent, latin = tmp_path / "absent.yaml", tmp_path / "latin.yaml"
    latin.write_bytes("a: 1\ntitle: Müller".encode("latin-1"))
    assert lines(read(absent)) == [f"{absent}: there is no such file"]
    assert lines(read(latin)) == [f"{latin}:2:9: not UTF-8 text; save the file as UTF-8"]
    assert lines(read(tmp_path)) == [f"{tmp_path}: cannot be read: Is a directory"]


def test_files_of_other_systems_are_read(tmp_path):
    (tmp_path / "r.yaml").write_bytes(b"\xef\xbb\xbfa: 1\r\nb: x\r\n")
    assert read(tmp_path / "r.yaml").data == {"a": 1, "b": "x"}


def test_a_file_too_large_to_be_a_recipe(tmp_path):
    (tmp_path / "r.yaml").write_text("#" * 1_000_001)
    (problem,) = read(tmp_path / "r.yaml").problems
    assert problem.message == "larger than 1000000 bytes; is it a recipe?"


scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(10**17), 10**17)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"]))
)
encodable = st.text(st.characters(exclude_categories=["Cs"]))
nested = st.dictionaries(encodable, st.lists(scalars) | st.dictionaries(encodable, scalars))


@given(st.dictionaries(encodable, scalars | st.lists(scalars) | nested))
def test_what_is_written_reads_back(data):
    source = compose(yaml_text(data), "f")
    assert not source.problems
    assert source.data == data


@given(st.text(alphabet=" \n-:?[]{},&*!|>'\"%@`#abc01.e~", max_size=60))
def test_any_text_gives_data_or_a_place(text):
    source = compose(text, "f")
    assert source.whole or source.problems
    for problem in source.problems:
        assert problem.line >= 1
        assert problem.column >= 1


@given(st.text(max_size=40) | st.binary(max_size=40).map(lambda raw: raw.decode("latin-1")))
def test_any_characters_give_data_or_a_problem(text):
    source = compose(text, "f")
    assert source.whole or source.problems


@given(st.text(alphabet=" \n-:[]{},'\"#abc", max_size=40))
def test_structure_is_that_of_the_reference_parser(text):
    source = compose(text, "f")
    reference = None
    with suppress(yaml.YAMLError, TypeError):
        reference = yaml.load(text, Loader=yaml.BaseLoader)  # noqa: S506
    if source.whole and not source.problems and source.data and isinstance(reference, list | dict):
        assert _as_text(source.data) == reference


def _as_text(data):
    if isinstance(data, dict):
        return {key: _as_text(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_as_text(value) for value in data]
    return "" if data is None else data
