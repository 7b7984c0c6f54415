"""Write a run's report again, or the paper's figures from several runs, from folders alone."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", nargs="+", help="run folder")
    parser.add_argument(
        "--paper",
        action="store_true",
        help="put the paper's Figures 2 to 5 from several runs on one page, and in SVG and PDF",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("paper"),
        metavar="DIR",
        help="where --paper writes (default: %(default)s)",
    )


def execute(options: argparse.Namespace) -> int:
    """Write report.html of each run, or the paper's page, and print what was written."""
    from labdrive.store.run_folder import RunFolder

    folders = [RunFolder.open(run).path for run in options.run]
    if options.paper:
        from labdrive.report.paper import write_paper

        written = write_paper(folders, options.out)
    else:
        from labdrive.report import write_report

        written = [write_report(folder) for folder in folders]
    print("\n".join(map(str, written)))
    return 0
