"""List the plugins found, where each comes from, and those that could not be used."""

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labdrive.interfaces.plugin_set import PluginSet


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def execute(options: argparse.Namespace) -> int:
    """Print the plugins; a broken one is told, and is no failure of this command."""
    from labdrive.engine.discovery import discover

    plugins = discover().plugins
    print(json.dumps(_as_dict(plugins)) if options.json else "\n".join(_lines(plugins)))
    return 0


def _as_dict(plugins: "PluginSet") -> dict[str, object]:
    found = [
        {"role": role, "name": name, "distribution": source}
        for (role, name), source in sorted(plugins.origin.items())
    ]
    return {"plugins": found, "broken": [asdict(broken) for broken in plugins.broken]}


def _lines(plugins: "PluginSet") -> list[str]:
    found = [
        f"{role:<12} {name:<24} {source}" for (role, name), source in sorted(plugins.origin.items())
    ]
    broken = [f"broken       {b.name:<24} {b.distribution}: {b.error}" for b in plugins.broken]
    return found + broken
