"""labdrive as a user types it, in a folder of its own: real processes, real kills."""

import os
import sqlite3
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

RECIPES = Path(__file__).parents[2] / "recipes"
QUICK = """kind: characterize
bench: bench.yaml
waveform: {trajectory: box}
motion: {periods: 4, samples_per_period: 64, period_rate: 20 Hz}
sensor: interferometer
"""


@dataclass
class Lab:
    folder: Path

    def command(self, *arguments):
        return [sys.executable, "-m", "labdrive", *map(str, arguments)]

    def __call__(self, *arguments, timeout=120):
        return subprocess.run(
            self.command(*arguments),
            cwd=self.folder,
            env=self.env,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )

    def start(self, *arguments):
        return subprocess.Popen(
            self.command(*arguments),
            cwd=self.folder,
            env=self.env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    @property
    def env(self):
        return {**os.environ, "LABDRIVE_STATE": str(self.folder / "state")}

    def make_due(self, name):
        """Let a schedule have been looked at two minutes ago."""
        with sqlite3.connect(self.folder / "state" / "queue.sqlite", timeout=30) as db:
            db.execute(
                "UPDATE schedules SET checked = strftime('%Y-%m-%dT%H:%M:%S+00:00', 'now', "
                "'-2 minutes') WHERE name = ?",
                (name,),
            )

    def jobs(self):
        with sqlite3.connect(self.folder / "state" / "queue.sqlite", timeout=30) as db:
            return db.execute(
                "SELECT state, reason, run, attempts FROM jobs ORDER BY due"
            ).fetchall()

    def wait(self, ready, timeout=90):
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            if found := ready():
                return found
            time.sleep(0.1)
        raise AssertionError(f"waited in vain; the jobs are {self.jobs()}")
