"""Watch over a run from outside; `run` and `resume` start this themselves."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    parser.add_argument("bench", type=Path, metavar="BENCH", help="bench file, for its lock")
    parser.add_argument("silence", type=float, metavar="SECONDS", help="longest without a reading")


def execute(options: argparse.Namespace) -> int:
    """Watch until the run is over; make its bench safe if it died or froze."""
    from labdrive.engine.supervisor import supervise
    from labdrive.store.run_folder import RunFolder

    supervise(RunFolder.open(options.run), options.bench, options.silence)
    return 0
