"""The queue: what is scheduled, what is due, what came of it; one SQLite file, safe with several.

Every change is a transaction that is on the disk when it returns (WAL, synchronous=FULL). That a
schedule is due once for each time, and that a bench runs one job at a time, is held by the file
itself, so by whatever number of services.
"""

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Literal

from labdrive.model.errors import InputError, StoreError
from labdrive.schedule.entry import Schedule

State = Literal["queued", "running", "done", "failed", "skipped"]

SCHEMA = """
CREATE TABLE IF NOT EXISTS schedules (
    name TEXT PRIMARY KEY, entry TEXT NOT NULL, paused INTEGER NOT NULL DEFAULT 0,
    checked TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS jobs (
    id INTEGER PRIMARY KEY, schedule TEXT NOT NULL, due TEXT NOT NULL, bench TEXT NOT NULL,
    state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0,
    failures INTEGER NOT NULL DEFAULT 0, not_before TEXT,
    worker TEXT, run TEXT, reason TEXT NOT NULL DEFAULT '', started TEXT, ended TEXT,
    UNIQUE (schedule, due));
CREATE UNIQUE INDEX IF NOT EXISTS one_running_a_bench ON jobs (bench) WHERE state = 'running';
CREATE INDEX IF NOT EXISTS by_state ON jobs (state, due);
"""
BUSY_S = 30.0
# Times later than that were written by a clock that was wrong.
FAR_AHEAD = timedelta(days=1)
COLUMNS = "id, schedule, due, bench, state, attempts, failures, worker, run, reason, started, ended"


@dataclass(frozen=True)
class Job:
    """One due time of a schedule, and what came of it. Times are ISO 8601 in UTC.

    `attempts`: how often it was begun; `failures`: how many of these failed, rather than having
    found the bench in use or been stopped with the service.
    """

    id: int
    schedule: str
    due: str
    bench: str
    state: State
    attempts: int
    failures: int
    worker: str | None
    run: str | None
    reason: str
    started: str | None
    ended: str | None


@dataclass(frozen=True)
class Scheduled:
    """A schedule as the queue knows it; `checked`: due times up to then have been queued."""

    entry: Schedule
    paused: bool
    checked: datetime


class Queue:
    """The queue in one file; StoreError if that cannot be read or written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._errors():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=FULL")
            self._db.executescript(SCHEMA)

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def put(self, entry: Schedule, now: datetime) -> None:
        """Add a schedule, or change the one of that name; new times are due from `now` on."""
        fields = entry.model_dump(mode="json")
        with self._change():
            row = self._db.execute(
                "SELECT entry, checked FROM schedules WHERE name = ?", (entry.name,)
            ).fetchone()
            former = {} if row is None else json.loads(row[0])
            same_times = all(former.get(key) == fields[key] for key in ("cron", "tz"))
            self._db.execute(
                "INSERT INTO schedules (name, entry, checked) VALUES (?, ?, ?) "
                "ON CONFLICT (name) DO UPDATE SET entry = excluded.entry, "
                "checked = excluded.checked",
                (entry.name, json.dumps(fields), row[1] if same_times else now.isoformat()),
            )

    def remove(self, name: str) -> None:
        """Remove a schedule and what of it waits; InputError if there is none of that name."""
        with self._change():
            self._known(name)
            self._db.execute("DELETE FROM schedules WHERE name = ?", (name,))
            self._db.execute("DELETE FROM jobs WHERE schedule = ? AND state = 'queued'", (name,))

    def pause(self, name: str, now: datetime, *, paused: bool) -> None:
        """Pause a schedule, or let it be due again from `now` on; InputError if there is none."""
        with self._change():
            self._known(name)
            self._db.execute(
                "UPDATE schedules SET paused = ?, checked = ? WHERE name = ?",
                (paused, now.isoformat(), name),
            )

    def look_from(self, name: str, when: datetime) -> None:
        """Let a schedule be due from `when` on, whatever was looked at before.

        What is in the queue already does not come into it a second time.
        """
        with self._change():
            self._db.execute(
                "UPDATE schedules SET checked = ? WHERE name = ?", (when.isoformat(), name)
            )

    def schedules(self) -> list[Scheduled]:
        """Return all schedules, by name."""
        with self._errors():
            rows = self._db.execute("SELECT entry, paused, checked FROM schedules ORDER BY name")
            return [
                Scheduled(_entry(text), bool(paused), datetime.fromisoformat(checked))
                for text, paused, checked in rows
            ]

    def schedule(self, name: str) -> Schedule | None:
        """Return the schedule of that name, None if it was removed."""
        return next((one.entry for one in self.schedules() if one.entry.name == name), None)

    def enqueue(
        self, name: str, bench: str, due: Sequence[tuple[datetime, State, str]], checked: datetime
    ) -> int:
        """Add due times with their state and reason; return how many were new.

        All are due up to `checked`, which is noted in the same breath: none is lost or doubled.
        """
        with self._change():
            added = 0
            for when, state, reason in due:
                done = self._db.execute(
                    "INSERT OR IGNORE INTO jobs (schedule, due, bench, state, reason) "
                    "VALUES (?, ?, ?, ?, ?)",
                    (name, when.isoformat(), bench, state, reason),
                )
                added += done.rowcount
            self._db.execute(
                "UPDATE schedules SET checked = max(checked, ?) WHERE name = ?",
                (checked.isoformat(), name),
            )
            return added

    def unfinished(self, name: str) -> int:
        """Return how many jobs of a schedule wait or run."""
        with self._errors():
            query = "SELECT count(*) FROM jobs WHERE schedule = ? AND state IN (?, ?)"
            return int(self._db.execute(query, (name, "queued", "running")).fetchone()[0])

    def claim(self, worker: str, now: datetime) -> Job | None:
        """Take the job that has waited longest on a bench that is free; None if there is none.

        None of a schedule that is paused.
        """
        with self._change():
            row = self._db.execute(
                f"SELECT {COLUMNS} FROM jobs WHERE state = 'queued' "  # noqa: S608 our own names
                "AND (not_before IS NULL OR not_before <= ? OR not_before > ?) "
                "AND schedule NOT IN (SELECT name FROM schedules WHERE paused) "
                "AND bench NOT IN (SELECT bench FROM jobs WHERE state = 'running') "
                "ORDER BY due, id LIMIT 1",
                (now.isoformat(), (now + FAR_AHEAD).isoformat()),
            ).fetchone()
            if row is None:
                return None
            self._db.execute(
                "UPDATE jobs SET state = 'running', worker = ?, started = ?, "
                "attempts = attempts + 1 WHERE id = ?",
                (worker, now.isoformat(), row[0]),
            )
        return self.job(row[0])

    def take_over(self, job: Job, worker: str, now: datetime) -> Job | None:
        """Take a running job from the service that had it; None if another one was faster."""
        with self._change():
            taken = self._db.execute(
                "UPDATE jobs SET worker = ?, started = ?, attempts = attempts + 1 "
                "WHERE id = ? AND state = 'running' AND worker IS ?",
                (worker, now.isoformat(), job.id, job.worker),
            )
        return self.job(job.id) if taken.rowcount else None

    def recover(self, job: Job, now: datetime) -> None:
        """Let a running job wait again, unless another service has done so, or taken it."""
        with self._change():
            self._db.execute(
                "UPDATE jobs SET state = 'queued', reason = 'cut short', worker = NULL, "
                "not_before = ? WHERE id = ? AND state = 'running' AND worker IS ?",
                (now.isoformat(), job.id, job.worker),
            )

    def finish(self, job: int, state: State, reason: str, run: str | None, now: datetime) -> None:
        """Note how a job ended."""
        with self._change():
            self._db.execute(
                "UPDATE jobs SET state = ?, reason = coalesce(nullif(?, ''), reason), "
                "run = coalesce(?, run), ended = ? WHERE id = ?",
                (state, reason, run, now.isoformat(), job),
            )

    def again(
        self, job: int, reason: str, run: str | None, not_before: datetime, *, failed: bool = False
    ) -> None:
        """Let a job wait once more, not before a time; `failed`: because it did."""
        with self._change():
            self._db.execute(
                "UPDATE jobs SET state = 'queued', reason = ?, run = coalesce(?, run), "
                "failures = failures + ?, worker = NULL, not_before = ? WHERE id = ?",
                (reason, run, failed, not_before.isoformat(), job),
            )

    def job(self, number: int) -> Job:
        """Return a job."""
        with self._errors():
            query = f"SELECT {COLUMNS} FROM jobs WHERE id = ?"  # noqa: S608 our own names
            return Job(*self._db.execute(query, (number,)).fetchone())

    def jobs(self, *states: State, last: int = -1) -> list[Job]:
        """Return the jobs in any of some states (all of them without), the newest `last`."""
        with self._errors():
            marks = ", ".join("?" * len(states))
            where = f"WHERE state IN ({marks})" if states else ""
            query = f"SELECT {COLUMNS} FROM jobs {where} ORDER BY due DESC, id DESC LIMIT ?"  # noqa: S608
            rows = self._db.execute(query, (*states, last)).fetchall()
        return [Job(*row) for row in reversed(rows)]

    def _known(self, name: str) -> None:
        if not self._db.execute("SELECT 1 FROM schedules WHERE name = ?", (name,)).fetchone():
            names = ", ".join(one.entry.name for one in self.schedules()) or "none"
            raise InputError(f"there is no schedule {name}; there are {names}")

    @contextmanager
    def _change(self) -> Iterator[None]:
        """Make one change, whole or not at all."""
        with self._errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                # A full disk can end the transaction by itself, or fail what ends it.
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"the job store {self.path}: {error}") from error


def _entry(text: str) -> Schedule:
    """Return a stored schedule; its files may have gone since, so they are not looked for."""
    fields = json.loads(text)
    return Schedule.model_construct(
        **{
            **fields,
            "recipe": Path(fields["recipe"]),
            "bench": Path(fields["bench"]) if fields["bench"] else None,
            "hang_after": _seconds(fields["hang_after"]),
        }
    )


def _seconds(text: str) -> float:
    from labdrive.model.units import parse

    return parse(text)[0]
