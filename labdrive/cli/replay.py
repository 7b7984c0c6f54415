"""Recompute a run from its journal and compare, bit for bit; nothing moves."""

import argparse
import json
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")


def execute(options: argparse.Namespace) -> int:
    """Replay the run; say that the result is the same, or raise ReplayError with the step."""
    from labdrive.engine.discovery import discover
    from labdrive.engine.replay import replay
    from labdrive.engine.versions import changed_versions
    from labdrive.store.run_folder import RunFolder

    folder, plugins = RunFolder.open(options.run), discover().plugins
    for change in changed_versions(folder.read_run(), plugins):
        print(f"since the run: {change}", file=sys.stderr)
    result = replay(folder, plugins)
    if options.json:
        print(json.dumps({**result, "run": str(folder.path)}))
    else:
        print(f"{folder.path}: the same result, bit for bit")
    return 0
