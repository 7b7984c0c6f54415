"""The wheel, installed alone in an environment of its own, finds its plugins and runs the demo."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """An interpreter that has the wheel installed, and the dependencies from this environment."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, ROOT]
    subprocess.run(build, check=True)
    (wheel,) = folder.glob("labdrive-*.whl")
    venv.create(folder / "env", with_pip=False)
    inside = folder / "env" / ("Scripts" if os.name == "nt" else "bin") / "python"
    paths = {"base": str(folder / "env"), "platbase": str(folder / "env")}
    site = Path(sysconfig.get_path("purelib", vars=paths))
    install = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--target",
        site,
        wheel,
    ]
    subprocess.run(install, check=True)
    # Found last, and without the .pth of the editable install: the wheel itself is what runs.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return inside


def run(python, folder, *arguments):
    return subprocess.run(
        [python, "-m", "labdrive", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def test_the_wheel_holds_package_plugins_and_recipes(python, tmp_path):
    where = subprocess.run(
        [python, "-c", "import labdrive, labdrive_sim; print(labdrive.__file__)"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert str(python.parents[1]) in where
    plugins = json.loads(run(python, tmp_path, "plugins", "--json"))
    assert plugins["broken"] == []
    names = {plugin["name"] for plugin in plugins["plugins"]}
    assert {"fourier", "optimize", "recording", "sim-walking-drive"} <= names


def test_the_demo_recipe_of_the_wheel_runs(python, tmp_path):
    recipes = run(python, tmp_path, "recipes", "--copy", "mine").split()
    assert str(Path("mine") / "optimize.yaml") in recipes
    quick = ("--set", "motion.periods=4", "--set", "stop.max_iterations=1")
    result = json.loads(run(python, tmp_path, "run", "mine/optimize.yaml", "--json", *quick))
    assert (tmp_path / result["run"] / "report.html").is_file()
    assert result["improvement"] > 5


def test_constraints_name_every_dependency_and_no_address():
    text = (ROOT / "constraints.txt").read_text()
    assert "http" not in text
    assert "index" not in text
    for name in ("numpy", "numba", "pydantic", "pyyaml", "pluggy", "h5netcdf", "matplotlib"):
        assert f"\n{name}==" in f"\n{text}"
