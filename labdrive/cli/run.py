"""Run a recipe into a new run folder, and write its report."""

import argparse
from pathlib import Path

from labdrive.cli import recipe_arguments, run_end


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    recipe_arguments.add_arguments(parser)
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where run folders go"
    )
    run_end.add_arguments(parser)


def execute(options: argparse.Namespace) -> int:
    """Run the recipe; return the exit code of how it ended."""
    from labdrive.cli.progress import listener
    from labdrive.engine.run import run

    with run_end.questions(options) as ask:
        prepared, host = recipe_arguments.prepare(options, ask)
        with listener() as listen:
            outcome = run(prepared, host, options.runs, listen, guarded=True)
    return run_end.report(outcome, as_json=options.json)
