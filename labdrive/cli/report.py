"""Write a run's report again, from its folder alone."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")


def execute(options: argparse.Namespace) -> int:
    """Write report.html and print where it is."""
    from labdrive.report import write_report
    from labdrive.store.run_folder import RunFolder

    print(write_report(RunFolder.open(options.run).path))
    return 0
