"""List the recipes that ship with labdrive, or copy them to a folder of yours."""

import argparse
import shutil
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--copy", type=Path, metavar="DIR", help="copy recipes and benches there")


def execute(options: argparse.Namespace) -> int:
    """Print where each recipe is, after copying if asked to."""
    folder = shipped()
    if options.copy is not None:
        _copy(folder, options.copy)
        folder = options.copy
    for recipe in sorted(folder.glob("*.yaml")):
        print(recipe)
    return 0


def shipped() -> Path:
    """Return the folder of the shipped recipes: in the wheel, or in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "recipes"
    return inside if inside.is_dir() else package.parent / "recipes"


def _copy(source: Path, target: Path) -> None:
    from labdrive.model.errors import InputError

    if target.exists() and any(target.iterdir()):
        raise InputError(f"{target} is not empty; name a new folder, to overwrite nothing")
    shutil.copytree(source, target, dirs_exist_ok=True, ignore=_recordings)


def _recordings(folder: str, names: list[str]) -> set[str]:
    """Leave linked recordings where they are; only the README that tells of them goes along."""
    return set(names) - {"README.md"} if Path(folder).name == "data" else set()
