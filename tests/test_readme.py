"""The README is true: its commands give what it shows, its plugin works."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NUMBER = re.compile(r"\d+\.?\d*")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def code(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def shown_output(command):
    """Return the indented lines that follow `$ command` in the README."""
    block = README.split(f"    $ {command}\n")[1]
    lines = block.lstrip("\n").split("\n\n")[0].splitlines()
    return "\n".join(line.removeprefix("    ") for line in lines)


@pytest.fixture
def folder(tmp_path):
    """A folder with the recipes in it, and the README's wrong one."""
    shutil.copytree(ROOT / "recipes", tmp_path / "recipes", ignore=lambda *_: {"data"})
    (tmp_path / "recipes" / "wrong.yaml").write_text(code("yaml")[1])
    return tmp_path


def labdrive(folder, command):
    words = [sys.executable, "-m", *command.split()]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("recipe", ["optimize", "wrong"])
def test_check_prints_what_the_readme_shows(folder, recipe):
    command = f"labdrive check recipes/{recipe}.yaml"
    done = labdrive(folder, command)
    assert (done.stdout + done.stderr).rstrip() == shown_output(command)


def test_run_prints_what_the_readme_shows(folder):
    command = "labdrive run recipes/optimize.yaml"
    lines = [line.partition(" ")[2] for line in labdrive(folder, command).stderr.splitlines()]
    left_out = ("on disk", "-optimize-", "walking back")
    told = [line for line in lines if not any(text in line for text in left_out)]
    shown = shown_output(command).splitlines()
    assert [NUMBER.sub("#", line) for line in told] == [NUMBER.sub("#", line) for line in shown]
    # The last digits may differ from one processor to the next.
    numbers = [[float(n) for n in NUMBER.findall(" ".join(lines))] for lines in (told, shown)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.02)


def test_the_recipe_shown_is_the_one_shipped():
    assert code("yaml")[0] == (ROOT / "recipes" / "optimize.yaml").read_text()


def test_every_recipe_and_command_named_exists():
    for recipe in re.findall(r"`(recipes/\w+\.yaml)`", README):
        assert (ROOT / recipe).is_file()
    commands = set(re.findall(r"`labdrive ([a-z-]+)", README))
    known = labdrive(ROOT, "labdrive --help").stdout
    assert all(re.search(rf"^    {command} ", known, re.MULTILINE) for command in commands)


def test_the_plugin_of_the_readme_is_found_and_takes_part(folder, monkeypatch):
    (folder / "mydrive.py").write_text(code("python")[0])
    info = folder / "mydrive-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mydrive\nVersion: 1.0\n")
    points = code("toml")[0].replace("project.entry-points.", "").replace('"', "")
    (info / "entry_points.txt").write_text(points)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    bench = folder / "recipes" / "benches" / "lt40-sim.yaml"
    sensor = "sensors:\n  room: {plugin: pt100, port: /dev/ttyUSB0, offset: 0.5 K}\n"
    bench.write_text(bench.read_text().replace("sensors:\n", sensor))
    done = labdrive(folder, "labdrive run recipes/characterize.yaml --json")
    assert done.returncode == 0, done.stderr
    (recording,) = folder.glob("runs/*/recordings/*.h5")
    from labdrive.store.recordings import read_recording

    assert set(read_recording(recording).readings["room"]) == {293.65}
