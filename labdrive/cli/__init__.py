"""The command line: one file a command, each importing what it needs only when it runs."""

import argparse
import os
import sys
from collections.abc import Sequence

from labdrive.cli import (
    check,
    plugins,
    recipes,
    replay,
    report,
    resume,
    run,
    runs,
    safe,
    schedule,
    schema,
    serve,
    supervise,
)
from labdrive.model.errors import LabdriveError

COMMANDS = (
    check,
    run,
    resume,
    replay,
    report,
    runs,
    schedule,
    serve,
    safe,
    recipes,
    plugins,
    schema,
    supervise,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, as the README lists them."""
    options = _parser().parse_args(argv)
    try:
        code: int = options.command(options)
    except LabdriveError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="labdrive",
        description="Measure and remove the periodic error of actuators, from recipes.",
        epilog="Exit codes: 0 done, 1 the run failed, 2 bad input, 3 an interlock stopped it, "
        "130 interrupted.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        name = command.__name__.rsplit(".", 1)[-1]
        summary = (command.__doc__ or "").strip().splitlines()[0]
        sub = commands.add_parser(name, help=summary, description=summary)
        command.add_arguments(sub)
        sub.set_defaults(command=command.execute)
    return parser
