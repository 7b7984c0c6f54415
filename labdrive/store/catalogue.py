"""An index of run folders, for those who have thousands: what the folders say, one file to ask.

The folders are the truth. The index (`.catalogue.sqlite` beside them) takes over what has changed
since it was last asked, may be deleted at any time, and is rebuilt by `labdrive runs reindex`.
"""

import json
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from labdrive.model.errors import StoreError
from labdrive.store.run_folder import list_runs, read_info

FILE = ".catalogue.sqlite"
SCHEMA = "CREATE TABLE IF NOT EXISTS runs (id TEXT PRIMARY KEY, changed INTEGER, info TEXT)"
BUSY_S = 10.0


def catalogued(root: Path) -> list[dict[str, Any]]:
    """Return what `list_runs` does, from the index; from the folders where it cannot be written."""
    if not root.is_dir():
        return []
    try:
        with closing(_open(root)) as index:
            _take_over(index, root)
            rows = index.execute("SELECT info FROM runs ORDER BY id DESC").fetchall()
    except sqlite3.Error:
        return list_runs(root)
    return [json.loads(info) for (info,) in rows]


def reindex(root: Path) -> int:
    """Build the index anew; return the number of runs. StoreError if it cannot be written."""
    try:
        for path in root.glob(f"{FILE}*"):
            path.unlink()
        with closing(_open(root)) as index:
            _take_over(index, root)
            return int(index.execute("SELECT count(*) FROM runs").fetchone()[0])
    except (sqlite3.Error, OSError) as error:
        raise StoreError(f"cannot write the catalogue {root / FILE}: {error}") from error


def _open(root: Path) -> sqlite3.Connection:
    index = sqlite3.connect(root / FILE, timeout=BUSY_S, isolation_level=None)
    index.execute("PRAGMA journal_mode=WAL")
    index.execute(SCHEMA)
    return index


def _take_over(index: sqlite3.Connection, root: Path) -> None:
    """Bring the index to what the folders say: new ones, changed ones, those that are gone."""
    known = dict(index.execute("SELECT id, changed FROM runs").fetchall())
    there = {}
    for path in root.glob("*/run.json"):
        with suppress(OSError):  # gone between being seen and being looked at
            there[path.parent.name] = path.stat().st_mtime_ns
    changed = [name for name, when in there.items() if known.get(name) != when]
    gone = known.keys() - there.keys()
    if not changed and not gone:
        return
    index.execute("BEGIN IMMEDIATE")
    index.executemany("DELETE FROM runs WHERE id = ?", [(name,) for name in gone])
    for name in changed:
        info = read_info(root / name)
        if info is not None:
            index.execute(
                "INSERT OR REPLACE INTO runs VALUES (?, ?, ?)",
                (name, there[name], json.dumps(info)),
            )
    index.execute("COMMIT")
