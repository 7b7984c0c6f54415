"""The command line as a user types it: a real process."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

RECIPES = Path(__file__).parents[2] / "recipes"


@dataclass
class Labdrive:
    """Runs `labdrive ...` in a folder."""

    folder: Path
    recipes: Path = RECIPES

    def __call__(self, *arguments, timeout=120):
        command = [sys.executable, "-m", "labdrive", *map(str, arguments)]
        return subprocess.run(
            command, cwd=self.folder, capture_output=True, text=True, timeout=timeout, check=False
        )

    def start(self, *arguments):
        command = [sys.executable, "-m", "labdrive", *map(str, arguments)]
        return subprocess.Popen(
            command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )


@pytest.fixture
def labdrive(tmp_path) -> Labdrive:
    return Labdrive(tmp_path)
