"""The page of a run: true, whole, the same each time, and safe to open."""

import json
import re
import subprocess
import sys
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from labdrive.model.recording import Recording
from labdrive.report import write_report
from labdrive.store.recordings import write_recording
from labdrive.store.run_folder import RunFolder

HOSTILE = '<script>alert("x")</script> & "quoted"'
VOID = {"meta", "br", "img", "link", "hr", "input"}


def entry(number, scale, unit_step=5e-6):
    harmonics = [
        {"k": k, "amplitude": scale / k, "phase": 0.3 * k, "standard_error": 1e-11}
        for k in range(1, 9)
    ]
    rms = float(np.sqrt(sum(h["amplitude"] ** 2 for h in harmonics) / 2))
    return {
        "step_size": unit_step,
        "periodic_error": {"pv": 3.1 * rms, "rms": rms},
        "noise_floor": {"rms": 2.8e-11},
        "harmonics": harmonics,
        "label": f"iteration {number}",
        "recording": f"recordings/{number + 1:04d}.h5",
    }


def record(folder, number, samples_per_period=64, periods=8):
    count = periods * samples_per_period + 1
    phase = 2 * np.pi * np.arange(count) / samples_per_period
    reading = 5e-6 * phase / (2 * np.pi) + 1e-7 / number * np.sin(phase)
    recording = Recording(
        number,
        "a",
        phase,
        phase / 10,
        {"interferometer": reading},
        {"interferometer": "m"},
        samples_per_period,
        periods,
    )
    write_recording(folder.path / "recordings", recording)


@pytest.fixture
def optimized(tmp_path):
    """A run folder as `optimize` leaves it; its title is not to be trusted."""
    now = datetime(2026, 11, 20, 19, 45, 12, tzinfo=UTC)
    folder = RunFolder.create(tmp_path, "optimize", now=now, token="3f9a")
    folder.write_run(
        {
            "id": folder.path.name,
            "kind": "optimize",
            "title": HOSTILE,
            "status": "done",
            "reason": "",
            "started": now.isoformat(),
            "versions": {"labdrive": "0.1.0", "plugins": {"sensors.x": "labdrive 0.1.0"}},
        }
    )
    iterations = [
        {"iteration": i, "table": f"iteration-{i:02d}", "remark": ""} | entry(i, 1e-7 / 50**i)
        for i in range(3)
    ]
    verification = entry(3, 5e-11)
    folder.write_result(
        {
            "kind": "optimize",
            "unit": "m",
            "sensor": "interferometer",
            "iterations": iterations,
            "stopped": "converged",
            "best_iteration": 2,
            "verification": verification,
            "improvement": 1234.5,
        }
    )
    phase = 2 * np.pi * np.arange(512) / 512
    for i in range(3):
        shift = 0.1 * i * np.sin(phase)
        folder.write_table(
            f"iteration-{i:02d}",
            {"phase_rad": phase, "psi_rad": phase + shift, "U0_V": 24 + 24 * np.sin(phase + shift)},
        )
    for number in range(1, 5):
        record(folder, number)
    folder.write_text("recipe.yaml", f"title: {HOSTILE}\n")
    return folder


class Checker(HTMLParser):
    """Balances tags, collects ids and whatever would be loaded."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.loads, self.scripts = [], [], [], 0

    def handle_starttag(self, tag, attributes):
        self.handle_startendtag(tag, attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.scripts += tag == "script"
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href") and not value.startswith("#"):
                self.loads.append(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def checked(path):
    checker = Checker()
    text = path.read_text(encoding="utf-8")
    checker.feed(text)
    checker.close()
    assert checker.open == []
    assert checker.loads == []
    assert checker.scripts == 0
    assert len(checker.ids) == len(set(checker.ids))
    for target in re.findall(r'(?:url\(#|href="#)([^)"]+)', text):
        assert target in checker.ids
    return text


def test_the_page_is_well_formed_loads_nothing_and_runs_nothing(optimized):
    text = checked(write_report(optimized.path))
    assert text.count("<svg") == 6
    assert HOSTILE not in text
    assert "&lt;script&gt;" in text


def test_the_numbers_are_those_of_the_result(optimized):
    text = write_report(optimized.path).read_text()
    result = json.loads((optimized.path / "result.json").read_text())
    first, last = result["iterations"][0], result["verification"]
    assert f"{first['periodic_error']['rms'] * 1e9:.3g} nm" in text
    assert f"{last['periodic_error']['rms'] * 1e12:.3g} pm" in text
    assert "1230 ×" in text
    assert "5.00000 µm" in text
    assert "gained next to nothing" in text


def test_the_same_folder_gives_the_same_bytes_in_another_process(optimized):
    here = write_report(optimized.path).read_bytes()
    command = [sys.executable, "-m", "labdrive", "report", optimized.path]
    subprocess.run(command, check=True, capture_output=True, env={"PYTHONHASHSEED": "7"})
    assert (optimized.path / "report.html").read_bytes() == here


def test_a_run_that_failed_has_a_page_that_says_why(optimized):
    (optimized.path / "result.json").unlink()
    optimized.write_run({**optimized.read_run(), "status": "failed", "reason": HOSTILE})
    text = checked(write_report(optimized.path))
    assert "failed" in text
    assert "4 recordings in the folder" in text


@pytest.mark.parametrize("lost", ["tables/*.csv", "recordings/*.h5", "recipe.yaml"])
def test_what_is_missing_is_left_out(optimized, lost):
    for path in list(optimized.path.glob(lost)):
        path.unlink()
    checked(write_report(optimized.path))


def test_a_result_of_another_kind_is_told_plainly(optimized):
    optimized.write_result({"kind": "tap_test", "resonance_hz": 812.5, "verdict": HOSTILE})
    text = checked(write_report(optimized.path))
    assert "812.5" in text


def test_a_recording_of_a_million_samples_keeps_the_page_small(optimized):
    record(optimized, 1, samples_per_period=4096, periods=256)
    assert write_report(optimized.path).stat().st_size < 3_000_000


@pytest.mark.parametrize("recipe", ["characterize", "optimize_spindle"])
def test_the_pages_of_shipped_recipes_are_well_formed(tmp_path, recipe):
    recipes = Path(__file__).parents[2] / "recipes"
    command = [sys.executable, "-m", "labdrive", "run", recipes / f"{recipe}.yaml"]
    subprocess.run([*command, "--runs", tmp_path], check=True, capture_output=True)
    (report,) = tmp_path.glob("*/report.html")
    checked(report)
