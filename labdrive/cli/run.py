"""Run a recipe into a new run folder, and write its report."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from labdrive.cli import recipe_arguments
from labdrive.model.errors import InputError

if TYPE_CHECKING:
    from labdrive.engine.run import Outcome


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    recipe_arguments.add_arguments(parser)
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where run folders go"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the result as one JSON object on stdout"
    )
    parser.add_argument(
        "--ask-page",
        type=int,
        metavar="PORT",
        help="put questions to the person at the bench on http://127.0.0.1:PORT/, not here",
    )


def execute(options: argparse.Namespace) -> int:
    """Run the recipe; return the exit code of how it ended."""
    if options.ask_page is None:
        return _run(options, None)
    from labdrive.cli.person_page import page

    try:
        with page(options.ask_page) as (address, ask):
            print(f"questions are put on {address}", file=sys.stderr, flush=True)
            return _run(options, ask)
    except (OSError, OverflowError) as error:
        raise InputError(f"--ask-page {options.ask_page}: cannot be served: {error}") from error


def _run(options: argparse.Namespace, ask: Callable[[str], str] | None) -> int:
    from labdrive.cli.progress import listener
    from labdrive.engine.run import run

    prepared, host = recipe_arguments.prepare(options, ask)
    with listener() as listen:
        outcome = run(prepared, host, options.runs, listen)
    report = _report(outcome.folder)
    if options.json:
        print(json.dumps({**_result(outcome), "run": str(outcome.folder)}))
    else:
        print(f"run     {outcome.folder}\nreport  {report}")
    if outcome.error is not None:
        print(f"{outcome.status}: {outcome.error}", file=sys.stderr)
        return outcome.error.exit_code
    return 0


def _result(outcome: "Outcome") -> dict[str, object]:
    if outcome.result is not None:
        return dict(outcome.result)
    return {"status": outcome.status, "reason": str(outcome.error)}


def _report(folder: Path) -> Path | str:
    """Write the report; a run that measured well is not lost because a plot failed."""
    from labdrive.report import write_report

    try:
        return write_report(folder)
    except Exception as error:  # noqa: BLE001 a report can be written again, a run cannot
        return f"none: {type(error).__name__}: {error} (try `labdrive report {folder}`)"
