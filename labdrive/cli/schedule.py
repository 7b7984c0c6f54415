"""Run recipes on a schedule: add, list, pause, remove; `labdrive serve` does the running."""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from labdrive.schedule.entry import Schedule
    from labdrive.schedule.queue import Queue


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions."""
    actions = parser.add_subparsers(required=True, metavar="ACTION", dest="action")
    add = _action(actions, "add", "add a schedule, or change the one of that name")
    add.add_argument("recipe", type=Path, metavar="RECIPE")
    add.add_argument("--bench", type=Path, metavar="FILE", help="instead of the recipe's")
    add.add_argument("--cron", required=True, help="as in '0 2 * * *': every night at two")
    add.add_argument("--tz", default="UTC", help="time zone, as Europe/Berlin")
    add.add_argument("--name", help="default: the recipe's file name")
    add.add_argument("--missed", default="run_once", help="run_once or skip")
    add.add_argument("--overlap", default="queue", help="queue or skip")
    add.add_argument("--retries", type=int, default=0)
    add.add_argument("--hang-after", default="10 min", help="without a sign of life, as '10 min'")
    add.add_argument("--alarm", metavar="METRIC", help="tell if it leaves its control limits")
    add.add_argument("--no-resume", action="store_true", help="begin again after a cut")
    _action(actions, "list", "schedules, when they are next due, and the last jobs")
    for name, what in (
        ("pause", "let it not be due; what waits stays"),
        ("resume", "let it be due again"),
    ):
        _action(actions, name, what).add_argument("name", metavar="NAME")
    _action(actions, "remove", "remove a schedule").add_argument("name", metavar="NAME")
    due = _action(actions, "next", "when schedules are next due")
    due.add_argument("--count", type=int, default=5)
    apply = _action(actions, "apply", "take over the schedules of a file that is kept in git")
    apply.add_argument("file", type=Path, metavar="schedules.yaml")
    apply.add_argument("--prune", action="store_true", help="remove those that are not in it")


def _action(actions: Any, name: str, what: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = actions.add_parser(name, help=what, description=what)
    parser.add_argument("--store", type=Path, metavar="FILE", help="the queue's file")
    return parser


def execute(options: argparse.Namespace) -> int:
    """Do what is asked."""
    from labdrive.schedule.queue import Queue

    queue = Queue(options.store or default_store())
    try:
        _ACTIONS[options.action](queue, options)
    finally:
        queue.close()
    return 0


def default_store() -> Path:
    """Return where the queue is unless told."""
    from labdrive.store.lock import state_folder

    return state_folder() / "queue.sqlite"


def _add(queue: "Queue", options: argparse.Namespace) -> None:
    from labdrive.recipe.load import load_fields
    from labdrive.schedule.entry import Schedule

    fields = {
        "name": options.name or options.recipe.stem,
        "recipe": str(options.recipe),
        "bench": None if options.bench is None else str(options.bench),
        "cron": options.cron,
        "tz": options.tz,
        "missed": options.missed,
        "overlap": options.overlap,
        "retries": options.retries,
        "hang_after": options.hang_after,
        "resume": not options.no_resume,
        "alarm": options.alarm,
    }
    _put(queue, load_fields(fields, "schedule add", Schedule))


def _apply(queue: "Queue", options: argparse.Namespace) -> None:
    from labdrive.recipe.load import load_file
    from labdrive.schedule.entry import ScheduleFile

    entries = load_file(options.file, ScheduleFile).schedules
    _refuse_same_names(options.file, entries)
    checked = [_checked(entry) for entry in entries]
    for entry in checked:
        _put_checked(queue, entry)
    names = {entry.name for entry in checked}
    for one in queue.schedules():
        if options.prune and one.entry.name not in names:
            queue.remove(one.entry.name)
            print(f"{one.entry.name}: removed")


def _refuse_same_names(path: Path, entries: "Sequence[Schedule]") -> None:
    """InputError, naming each line, if a name is given to two schedules: one would be lost."""
    from labdrive.model.errors import InputError
    from labdrive.recipe.yaml_source import read

    source, names = read(path), [entry.name for entry in entries]
    again = [i for i, name in enumerate(names) if name in names[:i]]
    if again:
        message = "another schedule above has this name; each needs its own"
        raise InputError(
            *(source.problem(("schedules", i, "name"), message, names[i]) for i in again)
        )


def _put(queue: "Queue", entry: "Schedule") -> None:
    _put_checked(queue, _checked(entry))


def _put_checked(queue: "Queue", entry: "Schedule") -> None:
    now = datetime.now(UTC)
    queue.put(entry, now)
    paused = any(one.paused for one in queue.schedules() if one.entry.name == entry.name)
    remedy = f"paused; labdrive schedule resume {entry.name} lets it be due"
    print(f"{entry.name}: {remedy if paused else _next(entry, now)}")


def _checked(entry: "Schedule") -> "Schedule":
    """Return the entry with its bench; InputError if its recipe could not be run unattended."""
    from labdrive.engine.discovery import discover
    from labdrive.engine.plan import prepare
    from labdrive.recipe.load import load

    plugins = discover().plugins
    loaded = load(entry.recipe, plugins, entry.bench)
    prepare(loaded, plugins).refuse_unattended()
    return entry.model_copy(update={"bench": Path(loaded.bench_path).resolve()})


def _list(queue: "Queue", _: argparse.Namespace) -> None:
    now = datetime.now(UTC)
    for one in queue.schedules():
        due = "paused" if one.paused else _next(one.entry, now)
        print(f"{one.entry.name:<24} {one.entry.cron:<16} {one.entry.tz:<16} {due}")
    for job in queue.jobs(last=20):
        told = f"{job.reason}  {job.run or ''}".strip()
        print(f"  {job.due}  {job.schedule:<20} {job.state:<8} {told}")


def _due(queue: "Queue", options: argparse.Namespace) -> None:
    from labdrive.schedule.calendar import next_due

    for one in queue.schedules():
        when: datetime | None = datetime.now(UTC)
        for _ in range(options.count):
            when = None if when is None else next_due(one.entry, when)
            if when is not None and not one.paused:
                print(f"{_local(one.entry, when)}  {one.entry.name}")


def _next(entry: "Schedule", now: datetime) -> str:
    from labdrive.schedule.calendar import next_due

    due = next_due(entry, now)
    return "never due" if due is None else f"next due {_local(entry, due)}"


def _local(entry: "Schedule", when: datetime) -> str:
    from zoneinfo import ZoneInfo

    return when.astimezone(ZoneInfo(entry.tz)).isoformat(timespec="minutes")


def _pause(queue: "Queue", options: argparse.Namespace) -> None:
    queue.pause(options.name, datetime.now(UTC), paused=True)


def _resume(queue: "Queue", options: argparse.Namespace) -> None:
    queue.pause(options.name, datetime.now(UTC), paused=False)


def _remove(queue: "Queue", options: argparse.Namespace) -> None:
    queue.remove(options.name)


_ACTIONS = {
    "add": _add,
    "apply": _apply,
    "list": _list,
    "next": _due,
    "pause": _pause,
    "remove": _remove,
    "resume": _resume,
}
