import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np
import pytest

from labdrive.model.errors import StoreError
from labdrive.report import write_report

VOID = {"meta", "br", "hr", "img", "link", "input", "wbr"}
NBSP = "\N{NO-BREAK SPACE}"


class Page(HTMLParser):
    """A page as a browser would take it; tags that do not close in turn are an error."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.addresses, self.tags = [], [], [], []
        self.title, self.headings, self.rows, self.words = "", [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self.rows[-1].append("")
        self._note(dict(attrs))

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self._note(dict(attrs))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)
        where = self.open[-1] if self.open else ""
        if where == "h2":
            self.headings.append(data)
        if where in {"td", "th"}:
            self.rows[-1][-1] += data
        if where == "h1":
            self.title += data

    def _note(self, attrs):
        self.ids += [attrs["id"]] if "id" in attrs else []
        self.addresses += [attrs[k] for k in ("href", "src", "xlink:href") if k in attrs]

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def page_of(folder):
    return Page(write_report(folder).read_text(encoding="utf-8"))


def result_of(folder):
    return json.loads((folder / "result.json").read_text())


def rewrite(path, **changes):
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def si(cell):
    """Return the SI value of a cell such as `232 nm`."""
    number, unit = cell.split(NBSP)
    return float(number) * {"pm": 1e-12, "nm": 1e-9, "µm": 1e-6}[unit]


def test_shows_each_figure_and_table_of_an_optimization_in_reading_order(optimized):
    page = page_of(optimized())
    assert page.headings == [
        "Periodic error over the phase",
        "Convergence",
        "Iterations",
        "Harmonics",
        "Leading harmonics",
        "Waveforms",
        "Phase map",
        "Raw recordings",
        "Where it comes from",
        "Recordings",
    ]
    assert page.tags.count("svg") == 6


@pytest.mark.parametrize("channels", [0, 4])
def test_numbers_are_those_of_the_result(optimized, channels):
    folder = optimized(channels)
    page, result = page_of(folder), result_of(folder)
    start = next(i for i, row in enumerate(page.rows) if "step size" in row)
    rows = {row[0]: row for row in page.rows[start : start + 5]}
    named = {str(i["iteration"]): i for i in result["iterations"]}
    for name, told in {**named, "verification": result["verification"]}.items():
        error, floor = told["periodic_error"], told["noise_floor"]["rms"]
        shown = [si(cell) for cell in rows[name][2:5]]
        assert shown == pytest.approx([error["rms"], error["pv"], floor], rel=5e-3)
        assert float(rows[name][5]) == pytest.approx(error["rms"] / floor, rel=5e-3)
    assert f"{result['improvement']:.0f}" in page.text


def test_harmonics_have_amplitude_error_and_phase_of_the_result(characterized):
    page, result = page_of(characterized), result_of(characterized)
    start = page.rows.index(["k", "amplitude (arcsec)", "standard error", "phase"])
    leading = sorted(result["harmonics"], key=lambda h: -h["amplitude"])
    arcsec = np.pi / 648000
    for row, harmonic in zip(page.rows[start + 1 :], leading, strict=False):
        k, *numbers = (float(cell.strip("°").replace("−", "-")) for cell in row)
        assert k == harmonic["k"]
        expected = (harmonic["amplitude"] / arcsec, 0.04, np.degrees(harmonic["phase"]))
        assert numbers == pytest.approx(expected, abs=0.051)


def test_a_characterization_tells_the_cycle_that_was_fitted(characterized):
    page = page_of(characterized)
    assert f"382.26 ± 0.53{NBSP}s" in "".join(page.words)
    assert page.tags.count("svg") == 3


def test_angles_are_drawn_less_the_phase_and_voltages_as_they_are(optimized):
    spindle = write_report(optimized(0)).read_text(encoding="utf-8")
    assert "angle − phase (deg)" in spindle
    assert "output (V)" not in spindle


def test_is_the_same_byte_for_byte_from_another_process(optimized):
    folder = optimized()
    here = write_report(folder).read_bytes()
    other = {**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    subprocess.run([sys.executable, "-m", "labdrive", "report", folder], check=True, env=other)
    assert (folder / "report.html").read_bytes() == here


def test_needs_nothing_from_elsewhere(optimized):
    text = write_report(optimized()).read_text(encoding="utf-8")
    assert all(address.startswith("#") for address in Page(text).addresses)
    assert "://" not in text
    assert "@import" not in text
    assert "<script" not in text


def test_every_id_is_there_once_and_every_reference_has_its_id(optimized):
    text = write_report(optimized()).read_text(encoding="utf-8")
    ids = Page(text).ids
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:href="|url\()#([^")]+)', text)) <= set(ids)


def test_figures_take_their_colours_from_the_page(optimized):
    text = write_report(optimized()).read_text(encoding="utf-8")
    figures = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert len(figures) == 6
    for figure in figures:
        assert not re.search(r"(?:fill|stroke): (?!none|var)", figure)
    used = set(re.findall(r"var\((--[\w-]+)\)", text))
    for scheme in re.findall(r":root \{(.*?)\}", text):
        assert used <= set(re.findall(r"(--[\w-]+):", scheme))


def test_hostile_titles_and_names_are_only_text(optimized):
    title = '<script>alert("1")</script> $\\frac{ & {{ 7*7 }}'
    folder = optimized(sensor="<b>$x_</b>", stopped="<i>no</i>")
    rewrite(folder / "run.json", title=title, host="</td><img src=x>", reason="<u>")
    (folder / "recipe.yaml").write_text("title: </pre><script>\n")
    for table in (folder / "tables").iterdir():
        table.write_text(table.read_text().replace("U0_V", r"<script>$\frac{_V"))
    page = page_of(folder)
    assert page.title == title
    assert not {"script", "b", "i", "u", "img"} & set(page.tags)
    assert r"<script>$\frac{" in page.text


def test_a_run_that_was_stopped_says_why_and_shows_what_there_is(optimized):
    folder = optimized()
    (folder / "result.json").unlink()
    reason = "force read 43.1 N, beyond the limit of 40 N"
    rewrite(folder / "run.json", status="stopped", reason=reason)
    page = page_of(folder)
    assert f"stopped : {reason}" in page.text
    assert "There is no result. The folder holds 4 recordings." in page.text
    assert page.headings == ["The last recording", "Where it comes from", "Recordings"]


def test_a_folder_with_nothing_but_a_damaged_recording_has_a_page(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings/0001.h5").write_bytes(b"not HDF5")
    page = page_of(tmp_path)
    assert page.title == tmp_path.name
    assert "at a time unknown" in page.text
    assert page.rows[-1][1].startswith("cannot be read")


@pytest.mark.parametrize("gone", ["tables", "recordings"])
def test_leaves_out_figures_whose_files_are_gone(optimized, gone):
    folder = optimized()
    for path in (folder / gone).iterdir():
        path.unlink()
    headings = page_of(folder).headings
    assert ("Waveforms" in headings) == (gone == "recordings")
    assert ("Raw recordings" in headings) == (gone == "tables")


def test_one_iteration_without_noise_needs_no_update(optimized):
    folder = optimized(iterations=1)
    result = result_of(folder)
    for told in (*result["iterations"], result["verification"]):
        told["noise_floor"]["rms"] = 0.0
        told["harmonics"] = [h | {"standard_error": 0.0} for h in told["harmonics"]]
    rewrite(folder / "result.json", **result)
    page = page_of(folder)
    assert "updated 0 times" in page.text
    assert "The recording shows no noise." in page.text
    assert "Phase map" not in page.headings


def test_no_error_at_all_can_be_drawn(optimized):
    folder = optimized()
    result = result_of(folder)
    for told in (*result["iterations"], result["verification"]):
        told["harmonics"] = []
        told["periodic_error"] = {"pv": 0.0, "rms": 0.0}
        told["noise_floor"]["rms"] = 0.0
    rewrite(folder / "result.json", **result)
    assert page_of(folder).tags.count("svg") == 6


def test_another_kind_is_shown_in_plain_tables(tmp_path, info):
    points = [{"load": 1.0, "step_size": 5.25e-6}, {"load": 2.0, "slipping": True}]
    result = {"kind": "stiffness_map", "unit": "m", "points": points, "fit": {"stall": 38.25}}
    (tmp_path / "run.json").write_text(json.dumps(info))
    (tmp_path / "result.json").write_text(json.dumps(result))
    rows = page_of(tmp_path).rows
    assert ["load", "step_size", "slipping"] in rows
    assert ["1", "5.25e-06", ""] in rows
    assert ["2", "", "True"] in rows
    assert ["stall", "38.25"] in rows


def test_provenance_names_seed_host_versions_plugins_files_and_duration(optimized):
    text = page_of(optimized()).text
    for told in (
        "2026-11-20 19:45:12 UTC, for 1 min 30 s",
        "seed 7",
        "host bench-3",
        "numpy 2.4.6",
        "actuators.lt40 labdrive 0.1.0",
        "voltage: {min: 0 V, max: 48 V}",
        "recordings/0004.h5",
        "tables/iteration-02.csv",
    ):
        assert told in text


def test_a_long_recording_makes_no_long_page(optimized):
    folder = optimized()
    count, spike = 1_200_000, 777_777
    phase = 1e9 + 2 * np.pi * np.arange(count) / 256
    reading = 0.3 + 4.5e-6 / 256 * np.arange(count)
    reading[spike] += 2e-6
    with h5py.File(folder / "recordings/0001.h5", "w") as file:
        file["phase"], file["interferometer"] = phase, reading
        file["interferometer"].attrs["units"] = "m"
    text = write_report(folder).read_text(encoding="utf-8")
    assert len(text) < 1_500_000
    raw = text[text.index("Raw recordings") :]
    # The spike must be the top of the axis: lost, the rest would be drawn in pm.
    assert "reading − line (µm)" in raw


@pytest.mark.parametrize("file", ["run.json", "result.json", "tables/iteration-00.csv"])
def test_a_damaged_file_is_an_error_that_names_it(optimized, file):
    folder = optimized()
    (folder / file).write_text("phase_rad,psi_rad\n{")
    with pytest.raises(StoreError, match=re.escape(file)):
        write_report(folder)
    assert not (folder / "report.html").exists()


def test_a_folder_that_cannot_be_written_leaves_no_half_page(optimized):
    folder = optimized()
    (folder / "report.html").mkdir()
    with pytest.raises(StoreError, match=r"report\.html"):
        write_report(folder)
    assert not list(folder.glob(".*"))


@pytest.mark.parametrize("recipe", ["characterize", "optimize_spindle"])
def test_runs_of_shipped_recipes_have_whole_pages(tmp_path, recipe):
    recipes = Path(__file__).parents[2] / "recipes"
    command = [sys.executable, "-m", "labdrive", "run", recipes / f"{recipe}.yaml"]
    subprocess.run([*command, "--runs", tmp_path], check=True, capture_output=True)
    (report,) = tmp_path.glob("*/report.html")
    page = Page(report.read_text(encoding="utf-8"))
    assert "Raw recording" in " ".join(page.headings)
    assert page.addresses
