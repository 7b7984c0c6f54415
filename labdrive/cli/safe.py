"""Make every actuator of a bench safe, whatever a run that is no more left it doing."""

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("bench", type=Path, metavar="BENCH", help="bench file (YAML)")


def execute(options: argparse.Namespace) -> int:
    """Make the bench's actuators safe, and say which."""
    from labdrive.engine.devices import build, made_safe
    from labdrive.engine.discovery import discover
    from labdrive.engine.run import bench_held
    from labdrive.recipe.load import load_bench

    plugins = discover().plugins
    bench = load_bench(options.bench, plugins)
    first = next(iter(bench.actuators))
    devices = build(bench, plugins, first, 0, options.bench.parent)
    with bench_held(str(options.bench), "making it safe"):
        failed = made_safe(devices)
    safe = [name for name in devices.actuators if name not in failed]
    print(f"safe: {', '.join(safe) or 'none'}")
    for name, why in failed.items():
        print(f"NOT made safe: {name}: {why}", file=sys.stderr)
    return 1 if failed else 0
