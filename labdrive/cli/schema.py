"""Write JSON Schemas with which an editor completes recipes and benches."""

import argparse
import json
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("which", nargs="?", choices=["recipe", "bench"], help="print only this one")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write recipe.schema.json and bench.schema.json"
    )


def execute(options: argparse.Namespace) -> int:
    """Print the schemas, or write one file each."""
    from labdrive.engine.discovery import discover
    from labdrive.recipe.schema import bench_schema, recipe_schema

    plugins = discover().plugins
    schemas = {"recipe": recipe_schema(plugins), "bench": bench_schema(plugins)}
    if options.out is not None:
        _write(options.out, schemas)
    else:
        print(json.dumps(schemas[options.which] if options.which else schemas, indent=2))
    return 0


def _write(folder: Path, schemas: dict[str, dict[str, object]]) -> None:
    from labdrive.store.durable import write_text

    folder.mkdir(parents=True, exist_ok=True)
    for name, schema in schemas.items():
        path = folder / f"{name}.schema.json"
        write_text(path, json.dumps(schema, indent=2) + "\n")
        print(path)
