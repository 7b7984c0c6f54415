"""List runs, show one, follow a number over many, or make room."""

import argparse
import json
import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labdrive.store.retention import Kept


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions; without one, runs are listed."""
    _runs(parser)
    parser.set_defaults(action=_list)
    actions = parser.add_subparsers(metavar="ACTION")
    listed = actions.add_parser("list", help="a line a run, newest first")
    listed.set_defaults(action=_list)
    show = actions.add_parser("show", help="all of one run's run.json")
    show.add_argument("run", nargs="?", type=Path, metavar="RUN", help="run folder")
    show.set_defaults(action=_show)
    trend = actions.add_parser("trend", help="a number of the result over many runs")
    trend.add_argument("--metric", default="periodic_error.rms", help="default: %(default)s")
    trend.add_argument("--bench", metavar="PART", help="only benches with this in their path")
    trend.add_argument("--recipe", metavar="PART", help="only recipes with this in their path")
    trend.add_argument("--plot", type=Path, metavar="FILE", help="draw it, as SVG or PDF")
    trend.set_defaults(action=_trend)
    prune = actions.add_parser("prune", help="remove old runs, but no recipe's last good one")
    prune.add_argument("--budget", type=_megabytes, metavar="MB", help="most that is left, in MB")
    prune.add_argument("--keep", type=_count, metavar="N", help="most runs that are left")
    prune.add_argument("--dry-run", action="store_true", help="only say what would go")
    prune.set_defaults(action=_prune)
    reindex = actions.add_parser("reindex", help="build the index of run folders anew")
    reindex.set_defaults(action=_reindex)
    for action in (listed, show, trend, prune, reindex):
        _runs(action)


def _runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where run folders are"
    )


def execute(options: argparse.Namespace) -> int:
    """Do what is asked."""
    code: int = options.action(options)
    return code


def _list(options: argparse.Namespace) -> int:
    from labdrive.store.catalogue import catalogued
    from labdrive.store.run_folder import present_status

    for info in catalogued(options.runs):
        status = present_status(options.runs / info["id"], info["status"])
        print(f"{info['id']}  {status:<11}  {info.get('title', '')}")
    return 0


def _reindex(options: argparse.Namespace) -> int:
    from labdrive.model.errors import InputError
    from labdrive.store.catalogue import reindex

    if not options.runs.is_dir():
        raise InputError(f"{options.runs} is no folder; name that of the runs with --runs")
    print(f"{reindex(options.runs)} runs")
    return 0


def _show(options: argparse.Namespace) -> int:
    from labdrive.model.errors import InputError
    from labdrive.store.run_folder import RunFolder

    if options.run is None:
        raise InputError("say which run to show: labdrive runs show RUN")
    path = options.run if options.run.exists() else options.runs / options.run
    print(json.dumps(RunFolder.open(path).read_run(), indent=2))
    return 0


def _trend(options: argparse.Namespace) -> int:
    from labdrive.model.errors import InputError
    from labdrive.model.units import format_si
    from labdrive.report.history import FEWEST, trend

    found = trend(options.runs, options.metric, options.bench, options.recipe)
    if found is None:
        raise InputError(
            f"fewer than {FEWEST} runs in {options.runs} have a {options.metric}; name another "
            "metric, as step_size or noise_floor.rms, or another folder"
        )
    for point in found.points:
        value = format_si(point.value, found.unit, 4)
        print(f"{point.run}  {value:>12}  {point.alarm}".rstrip())
    low, centre, high = (format_si(v, found.unit, 4) for v in (found.low, found.centre, found.high))
    print(f"control limits {low} to {high}, centre {centre}")
    if options.plot is not None:
        from labdrive.report.trend import draw_trend

        draw_trend(found, options.plot)
        print(options.plot)
    return 0


def _prune(options: argparse.Namespace) -> int:
    from labdrive.model.errors import InputError
    from labdrive.store.retention import remove, runs_by_age, to_go

    if options.budget is None and options.keep is None:
        raise InputError("say how much is to be left: --budget MB, --keep N, or both")
    budget = None if options.budget is None else int(1e6 * options.budget)
    left = runs_by_age(options.runs)
    for run in list(to_go(left, budget, options.keep)):
        gone = options.dry_run or remove(run)
        done = "would go" if options.dry_run else "gone" if gone else "at work"
        print(f"{run.path.name}  {run.size / 1e6:.1f} MB  {done}")
        if gone:
            left.remove(run)
    _tell_left(left, budget, options.keep)
    return 0


def _tell_left(left: "list[Kept]", budget: int | None, keep: int | None) -> None:
    """Say what is left, and why, if that is more than was asked for."""
    size = sum(run.size for run in left)
    if (budget is None or size <= budget) and (keep is None or len(left) <= keep):
        return
    print(f"left: {len(left)} runs, {size / 1e6:.1f} MB, more than asked for, as these stay:")
    for run in left:
        if run.why:
            print(f"{run.path.name}  {run.size / 1e6:.1f} MB  {run.why}")


def _megabytes(text: str) -> float:
    """Return a size from the command line; none is endless, or no number."""
    with suppress(ValueError):
        if 0 <= (size := float(text)) < math.inf:
            return size
    raise argparse.ArgumentTypeError(f"{text} is no size in MB, as 20000")


def _count(text: str) -> int:
    with suppress(ValueError):
        if (count := int(text)) >= 0:
            return count
    raise argparse.ArgumentTypeError(f"{text} is no number of runs, as 500")
