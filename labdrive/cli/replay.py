"""Recompute a run from its journal and compare, or ask what other settings would have proposed."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labdrive.engine.what_if import WhatIf
    from labdrive.interfaces.plugin_set import PluginSet
    from labdrive.store.run_folder import RunFolder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        dest="overrides",
        help="what would the run have done with this instead, as in optimizer.groups=symmetric?",
    )


def execute(options: argparse.Namespace) -> int:
    """Replay the run; say that the result is the same, or raise ReplayError with the step."""
    from labdrive.engine.discovery import discover
    from labdrive.engine.replay import replay
    from labdrive.engine.versions import changed_versions
    from labdrive.store.run_folder import RunFolder

    folder, plugins = RunFolder.open(options.run), discover().plugins
    for change in changed_versions(folder.read_run(), plugins):
        print(f"since the run: {change}", file=sys.stderr)
    if options.overrides:
        return _what_if(folder, plugins, options)
    result = replay(folder, plugins)
    if options.json:
        print(json.dumps({**result, "run": str(folder.path)}))
    else:
        print(f"{folder.path}: the same result, bit for bit")
    return 0


def _what_if(folder: "RunFolder", plugins: "PluginSet", options: argparse.Namespace) -> int:
    from labdrive.engine.what_if import what_if

    found = what_if(
        folder, plugins, tuple(options.overrides), lambda text: print(text, file=sys.stderr)
    )
    if options.json:
        print(json.dumps(_as_json(found)))
    else:
        print("\n".join(_told(found)))
    return 0


def _told(found: "WhatIf") -> list[str]:
    from labdrive.model.units import format_si

    if found.result is not None:
        return ["the recordings answer all of it; nothing else would have been recorded"]
    lines = [f"{_departure(found)}; the recordings answer up to there"]
    for one in found.differences:
        largest, rms = format_si(one.largest, one.unit, 3), format_si(one.rms, one.unit, 3)
        lines.append(f"  {one.channel}: off what was played by up to {largest}, {rms} rms")
    return lines


def _departure(found: "WhatIf") -> str:
    """Return in words what was asked for that the run did not do."""
    from labdrive.model.units import format_si

    if found.load is not None:
        asked, was = format_si(found.load.asked, "N"), found.load.was
        instead = "no further one" if was is None else format_si(was, "N")
        return (
            f"before recording {found.number} a load of {asked} would have been set, where the run "
            f"set {instead}"
        )
    one = f"recording {found.number} ({found.label})"
    if "more recordings" in found.asks_for:
        return f"{one} would have been made besides"
    return f"{one} would have been of another {', '.join(found.asks_for)}"


def _as_json(found: "WhatIf") -> dict[str, object]:
    return {
        "result": found.result,
        "departs_at": {"recording": found.number, "label": found.label} if found.number else None,
        "asks_for": list(found.asks_for),
        "load": found.load and vars(found.load),
        "differences": [vars(one) for one in found.differences],
    }
