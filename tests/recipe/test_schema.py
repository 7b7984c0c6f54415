import json

from labdrive.interfaces.plugin_set import PluginSet
from labdrive.recipe.schema import bench_schema, recipe_schema


def section(schema, model):
    return schema["$defs"][model]["properties"]


def test_each_kind_is_a_branch_that_its_name_chooses(plugins):
    schema = recipe_schema(plugins)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    branches = [branch["$ref"].rsplit("/", 1)[1] for branch in schema["oneOf"]]
    kinds = [section(schema, branch)["kind"]["const"] for branch in branches]
    assert kinds == ["optimize", "survey"]
    for branch in branches:
        assert "kind" in schema["$defs"][branch]["required"]
        assert schema["$defs"][branch]["additionalProperties"] is False


def test_plugin_settings_are_included_where_a_plugin_fills_a_slot(plugins):
    schema = recipe_schema(plugins)
    slot = section(schema, "experiments_optimize")["optimizer"]
    assert [b["$ref"] for b in slot["oneOf"]] == [
        "#/$defs/optimizers_fourier",
        "#/$defs/optimizers_bisect",
    ]
    fourier = section(schema, "optimizers_fourier")
    assert fourier["estimator"]["enum"] == ["exact", "paper"]
    assert fourier["use"] == {
        "const": "fourier",
        "description": "Corrects harmonics.",
        "type": "string",
    }


def test_quantities_are_text_with_an_example_and_their_defaults_too(plugins):
    rate = section(recipe_schema(plugins), "MotionSettings")["period_rate"]
    assert (rate["type"], rate["examples"]) == ("string", ["2 Hz"])
    bench = bench_schema(plugins)
    assert section(bench, "actuators_stage")["pitch"]["default"] == "1 mm"
    assert section(bench, "sensors_ruler")["scale"]["default"] == "500 mrad"


def test_a_bench_needs_something_that_moves_and_something_that_reads(plugins):
    schema = bench_schema(plugins)
    assert schema["required"] == ["actuators", "sensors"]
    assert schema["properties"]["actuators"]["minProperties"] == 1
    assert schema["additionalProperties"] is False


def test_devices_of_plugins_that_did_not_ask_are_strict_too(plugins):
    assert bench_schema(plugins)["$defs"]["sensors_ruler"]["additionalProperties"] is False


def test_schemas_are_json_whatever_is_installed(plugins):
    for installed in (plugins, PluginSet()):
        assert json.loads(json.dumps(recipe_schema(installed))) == recipe_schema(installed)
        assert json.loads(json.dumps(bench_schema(installed))) == bench_schema(installed)
