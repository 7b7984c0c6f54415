"""Go on with a run that was cut short, from where its journal ends."""

import argparse
from pathlib import Path

from labdrive.cli import run_end


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    run_end.add_arguments(parser)


def execute(options: argparse.Namespace) -> int:
    """Resume the run; return the exit code of how it ended."""
    from labdrive.cli.progress import listener
    from labdrive.engine.discovery import discover
    from labdrive.engine.resume import resume

    host = discover()
    with run_end.questions(options) as ask, listener() as listen:
        outcome = resume(options.run, host, listen, ask, guarded=True)
    return run_end.report(outcome, as_json=options.json)
