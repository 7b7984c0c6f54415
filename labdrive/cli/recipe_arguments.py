"""What the commands that read a recipe have in common."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labdrive.engine.discovery import PluginHost
    from labdrive.engine.plan import Prepared


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recipe, and what overrides parts of it."""
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="recipe file (YAML)")
    parser.add_argument(
        "--bench", type=Path, metavar="FILE", help="bench file, instead of the recipe's"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        dest="overrides",
        help="override a field of the recipe, as in motion.periods=64; may be repeated",
    )


def prepare(
    options: argparse.Namespace, ask: Callable[[str], str] | None = None
) -> "tuple[Prepared, PluginHost]":
    """Load, validate and plan the recipe; InputError with every problem found.

    `ask` reaches the person at the bench, if there is one.
    """
    from labdrive.engine.discovery import discover
    from labdrive.engine.plan import prepare as prepare_recipe
    from labdrive.recipe.load import load

    host = discover()
    for broken in host.plugins.broken:
        print(f"plugin {broken.name} left out: {broken.error}", file=sys.stderr)
    loaded = load(options.recipe, host.plugins, options.bench, tuple(options.overrides))
    return prepare_recipe(loaded, host.plugins, ask), host
