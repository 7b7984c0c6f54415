"""JSON Schema of recipes and benches, for editors that complete and check YAML as it is typed."""

from contextlib import suppress
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import SchemaError, SchemaSerializer, core_schema

from labdrive.interfaces.plugin_set import PluginSet
from labdrive.recipe.models import bench_model, recipe_model


def recipe_schema(plugins: PluginSet) -> dict[str, Any]:
    """Return the schema of recipes, with the settings of every installed plugin."""
    schema = _schema(recipe_model(plugins), "labdrive recipe")
    _name_trajectories(schema, list(plugins.trajectories))
    return schema


def bench_schema(plugins: PluginSet) -> dict[str, Any]:
    """Return the schema of benches, with the settings of every installed plugin."""
    return _schema(bench_model(plugins), "labdrive bench")


def _schema(model: Any, title: str) -> dict[str, Any]:
    adapter: TypeAdapter[Any] = TypeAdapter(model)
    schema = adapter.json_schema(schema_generator=_WithDefaultsAsWritten)
    return {"$schema": GenerateJsonSchema.schema_dialect, **schema, "title": title}


def _name_trajectories(part: Any, names: list[str]) -> None:
    """Offer the installed trajectories wherever one is named: no field knows them by itself."""
    if isinstance(part, dict) and part.get("format") == "trajectory":
        part.pop("format")
        part["anyOf"] = [{"enum": names}, {"pattern": r"\.[cC][sS][vV]$"}]
    for inner in (
        part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    ):
        _name_trajectories(inner, names)


class _WithDefaultsAsWritten(GenerateJsonSchema):
    """Gives defaults as a file would: `5 um`, not 5e-6."""

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Return the schema of a field that has a default."""
        written = super().default_schema(schema)
        # A schema that refers to a shared definition has no serializer of its own, and no unit.
        with suppress(SchemaError):
            if "default" in written:
                serializer = SchemaSerializer(schema["schema"])
                written["default"] = serializer.to_python(schema["default"], mode="json")
        return written

    def field_title_should_be_set(self, schema: object) -> bool:  # noqa: ARG002
        """Leave out titles that only repeat the name."""
        return False
