"""Starting is quick: heavy libraries load only where they are used."""

import subprocess
import sys
from resource import RUSAGE_CHILDREN, getrusage

import pytest


def best_of(count, *command):
    """Return the least processor time of `count` runs [s]: others may be busy meanwhile."""
    times = []
    for _ in range(count):
        before = getrusage(RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = getrusage(RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


@pytest.mark.parametrize(
    ("arguments", "most"),
    [(["--help"], 12), (["check", "optimize.yaml"], 120)],
    ids=["help", "check"],
)
def test_start_in_multiples_of_a_bare_interpreter(labdrive, arguments, most):
    paths = [str(labdrive.recipes / a) if a.endswith(".yaml") else a for a in arguments]
    bare = best_of(10, sys.executable, "-c", "pass")
    ours = best_of(5, sys.executable, "-m", "labdrive", *paths)
    assert ours < most * bare


@pytest.mark.parametrize(
    ("code", "banned"),
    [
        ("import labdrive.__main__", {"numpy", "pydantic", "pluggy", "yaml"}),
        (
            "from labdrive.cli import main; main(['check', {recipe!r}])",
            {"numba", "scipy", "h5py", "h5netcdf", "matplotlib", "jinja2", "rich"},
        ),
    ],
)
def test_what_must_not_be_imported_is_not(labdrive, code, banned):
    code = code.format(recipe=str(labdrive.recipes / "optimize.yaml"))
    probe = f"{code}\nimport sys; print('loaded:', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", probe], check=True, capture_output=True, text=True)
    assert not banned & set(done.stdout.split("loaded:")[1].split())
