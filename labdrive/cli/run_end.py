"""What commands that run a recipe to its end have in common."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from labdrive.model.errors import InputError

if TYPE_CHECKING:
    from labdrive.engine.run import Outcome


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add how to ask a person, and how to tell the result."""
    parser.add_argument(
        "--json", action="store_true", help="print the result as one JSON object on stdout"
    )
    parser.add_argument(
        "--ask-page",
        type=int,
        metavar="PORT",
        help="put questions to the person at the bench on http://127.0.0.1:PORT/, not here",
    )


@contextmanager
def questions(options: argparse.Namespace) -> Iterator[Callable[[str], str] | None]:
    """Yield what asks the person at the bench, on the page or at the terminal; None if nobody."""
    from labdrive.cli.person import person

    if options.ask_page is None:
        yield person()
        return
    from labdrive.cli.person_page import page

    with ExitStack() as stack:
        try:
            address, ask = stack.enter_context(page(options.ask_page))
        except (OSError, OverflowError) as error:
            raise InputError(f"--ask-page {options.ask_page}: cannot be served: {error}") from error
        print(f"questions are put on {address}", file=sys.stderr, flush=True)
        yield ask


def report(outcome: "Outcome", *, as_json: bool) -> int:
    """Write the report, print the result; return the exit code."""
    written = _report(outcome.folder)
    if as_json:
        print(json.dumps({**_result(outcome), "run": str(outcome.folder)}))
    else:
        print(f"run     {outcome.folder}\nreport  {written}")
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
