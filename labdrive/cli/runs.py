"""List runs, or show one."""

import argparse
import json
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("action", nargs="?", choices=["list", "show"], default="list")
    parser.add_argument("run", nargs="?", type=Path, metavar="RUN", help="run folder, for show")
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where run folders are"
    )


def execute(options: argparse.Namespace) -> int:
    """Print a line a run, newest first, or all of one run's run.json."""
    return _show(options) if options.action == "show" else _list(options.runs)


def _list(root: Path) -> int:
    from labdrive.store.run_folder import list_runs

    for info in list_runs(root):
        print(f"{info['id']}  {info['status']:<11}  {info.get('title', '')}")
    return 0


def _show(options: argparse.Namespace) -> int:
    from labdrive.model.errors import InputError
    from labdrive.store.run_folder import RunFolder

    if options.run is None:
        raise InputError("say which run to show: labdrive runs show RUN")
    path = options.run if options.run.exists() else options.runs / options.run
    print(json.dumps(RunFolder.open(path).read_run(), indent=2))
    return 0
