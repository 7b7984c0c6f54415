"""Put a run's page together."""

from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType

from labdrive.report import characterize, optimize, plain
from labdrive.report.run_data import RunData

KINDS: dict[str, ModuleType] = {"optimize": optimize, "characterize": characterize}
TEMPLATES = Path(__file__).with_name("templates")


def page(folder: Path) -> str:
    """Return the page of the run in `folder` as HTML."""
    from jinja2 import Environment, FileSystemLoader  # noqa: PLC0415 for reports only

    run = RunData(folder)
    kind = KINDS.get(run.result.get("kind", ""), plain)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("page.html").render(
        info=run.info,
        when=_when(run.info.get("started")),
        title=run.info.get("title") or run.info.get("kind") or folder.name,
        facts=kind.facts(run),
        summary=kind.summary(run),
        sections=kind.sections(run),
        recordings=run.recordings,
        recipe=run.text("recipe.yaml"),
        bench=run.text("bench.yaml"),
    )


def _when(started: str | None) -> str:
    """Return a time of run.json as a person writes it."""
    if not started:
        return "no time known"
    return datetime.fromisoformat(started).astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
