"""A validator that knows nothing of labdrive accepts the shipped files and refuses wrong ones."""

from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from labdrive.engine.discovery import discover
from labdrive.recipe.schema import bench_schema, recipe_schema

RECIPES = Path(__file__).parents[2] / "recipes"


@pytest.fixture(scope="module")
def validators():
    plugins = discover().plugins
    schemas = {"recipe": recipe_schema(plugins), "bench": bench_schema(plugins)}
    for schema in schemas.values():
        Draft202012Validator.check_schema(schema)
    return {name: Draft202012Validator(schema) for name, schema in schemas.items()}


@pytest.mark.parametrize("path", sorted(RECIPES.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_recipes_are_valid(validators, path):
    validators["recipe"].validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize("path", sorted(RECIPES.glob("benches/*.yaml")), ids=lambda path: path.stem)
def test_shipped_benches_are_valid(validators, path):
    validators["bench"].validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("period_rate: 2 Hz", "period_rate: 2"),
        ("period_rate: 2 Hz", "period_rate: 2 um"),
        ("estimator: exact", "estimator: exakt"),
        ("use: fourier", "use: furier"),
        ("sensor: interferometer", "sensr: interferometer"),
        ("trajectory: ellipse", "trajectory: circle"),
    ],
)
def test_wrong_recipes_are_not(validators, old, new):
    text = (RECIPES / "optimize.yaml").read_text()
    assert old in text
    assert not validators["recipe"].is_valid(yaml.safe_load(text.replace(old, new)))
