"""Put a run's page together."""

from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType
from typing import Any

from labdrive.report import (
    characterize,
    characterize_spindle,
    identify_legs,
    load_sweep,
    optimize,
    optimize_drives,
    plain,
    reverse_check,
    scaling_sweep,
)
from labdrive.report.palette import variables
from labdrive.report.recordings import contents
from labdrive.report.run_data import RunData

KINDS: dict[str, ModuleType] = {
    "characterize": characterize,
    "characterize_spindle": characterize_spindle,
    "identify_legs": identify_legs,
    "load_sweep": load_sweep,
    "optimize": optimize,
    "optimize_drives": optimize_drives,
    "reverse_check": reverse_check,
    "scaling_sweep": scaling_sweep,
}
TEMPLATES = Path(__file__).with_name("templates")
TOLD = (
    "status",
    "started",
    "ended",
    "recipe",
    "bench",
    "actuator",
    "command",
    "seed",
    "host",
    "platform",
)


def page(folder: Path) -> str:
    """Return the page of the run in `folder` as HTML. StoreError if a file of it is damaged."""
    from jinja2 import Environment, FileSystemLoader

    run = RunData(folder)
    kind = KINDS.get(run.result.get("kind", ""), plain)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("page.html").render(
        light=variables(dark=False),
        dark=variables(dark=True),
        info=run.info,
        title=run.info.get("title") or run.info.get("kind") or folder.name,
        run=run,
        name=run.info.get("id") or folder.name,
        when=_when(run.info),
        facts=kind.facts(run),
        summary=kind.summary(run),
        sections=kind.sections(run),
        told=_told(run.info),
        plugins=_plugins(run.info),
        recordings=[(file, *contents(folder / file)) for file in run.recordings],
    )


def _told(info: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what run.json says of where the run comes from, but for times and plugins."""
    versions = info.get("versions") or {}
    named = [(name, v) for name, v in versions.items() if isinstance(v, str)]
    return [(key, str(info[key])) for key in TOLD if info.get(key) is not None] + named


def _plugins(info: dict[str, Any]) -> list[tuple[str, str]]:
    plugins = (info.get("versions") or {}).get("plugins") or {}
    return sorted((name, str(version)) for name, version in plugins.items())


def _when(info: dict[str, Any]) -> str:
    """Return when the run was, and how long it took, as a person writes it."""
    started, ended = _time(info.get("started")), _time(info.get("ended"))
    if started is None:
        return "at a time unknown"
    told = started.strftime("%Y-%m-%d %H:%M:%S UTC")
    return told if ended is None else f"{told}, for {_span((ended - started).total_seconds())}"


def _time(text: str | None) -> datetime | None:
    try:
        return datetime.fromisoformat(text or "").astimezone(UTC)
    except ValueError:
        return None


def _span(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
