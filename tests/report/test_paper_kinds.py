"""Reports of the paper's recipes, and its figures on one page."""

import xml.etree.ElementTree as ET

import pytest

from labdrive.engine.discovery import discover
from labdrive.engine.plan import prepare
from labdrive.engine.run import run
from labdrive.model.errors import InputError
from labdrive.recipe.load import load
from labdrive.report import write_report
from labdrive.report.paper import write_paper

QUICK = ("motion.periods=4", "motion.samples_per_period=64")
LOADS = ("loads=[0 N, 20 N, 40 N, 60 N]", "stall_within=10 N")
RUNS = {
    "identify_legs": QUICK,
    "load_sweep": (*QUICK, *LOADS, "waveforms=[{trajectory: triangle}, {trajectory: box}]"),
    "scaling_sweep": (*QUICK, *LOADS, "scales=[0.6]"),
    "optimize": (*QUICK, "stop.max_iterations=2"),
    "reverse_check": (*QUICK, "stop.max_iterations=1"),
    "optimize_drives": (*QUICK, "stop.max_iterations=1"),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a run folder of each kind."""
    from pathlib import Path

    recipes, host = Path(__file__).parents[2] / "recipes", discover()
    base = tmp_path_factory.mktemp("runs")
    folders = {}
    for kind, overrides in RUNS.items():
        prepared = prepare(
            load(recipes / f"{kind}.yaml", host.plugins, None, overrides), host.plugins
        )
        outcome = run(prepared, host, base, lambda _: None)
        assert outcome.error is None
        folders[kind] = outcome.folder
    return folders


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("identify_legs", ["R² of x", "opening of the loop", "Plays", "m11"]),
        ("load_sweep", ["triangle: unloaded step, stall load", "compliance", "stalls at"]),
        ("scaling_sweep", ["of the stall load, x scaled to 0.6", "held as high", "With the scale"]),
        ("reverse_check", ["swapped backward, rms", "Each map in each direction", "switch_phase"]),
        ("optimize_drives", ["Cross-talk", "x: convergence", "share of the travel"]),
        ("optimize", ["Speed of the tip"]),
    ],
)
def test_each_kind_has_a_report_of_its_own(runs, kind, told):
    page = write_report(runs[kind]).read_text()
    for text in told:
        assert text in page
    assert page.count("<svg") >= 1
    assert page == write_report(runs[kind]).read_text()


def test_the_papers_figures_come_on_one_page_and_as_files(runs, tmp_path):
    written = write_paper(list(runs.values()), tmp_path / "paper")
    names = sorted(path.name for path in written)
    figures = [f"figure-{n}.{kind}" for n in (2, 3, 4, 5) for kind in ("pdf", "svg")]
    assert names == sorted([*figures, "paper.html"])
    page = (tmp_path / "paper" / "paper.html").read_text()
    for number in (2, 3, 4, 5):
        assert f"<h2>Figure {number}</h2>" in page
        assert f'href="figure-{number}.svg"' in page
        assert (tmp_path / "paper" / f"figure-{number}.pdf").read_bytes().startswith(b"%PDF")
        ET.parse(tmp_path / "paper" / f"figure-{number}.svg")  # noqa: S314 - our own file
    again = write_paper(list(runs.values()), tmp_path / "again")
    for one, other in zip(written, again, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_figure_needs_its_run(runs, tmp_path):
    written = write_paper([runs["reverse_check"]], tmp_path)
    assert [path.name for path in written] == ["paper.html", "figure-5.svg", "figure-5.pdf"]
    with pytest.raises(InputError, match="none of the runs shows a figure of the paper"):
        write_paper([runs["optimize_drives"]], tmp_path)
