"""`load_sweep`: step size against external load, for several waveforms (paper, Figure 2c)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from labdrive.experiments.load_points import LoadPoints, LoadSettings, Subject, result
from labdrive.experiments.waveform_list import nominal_tables
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.waveform import Waveform


class LoadSweep:
    """Loads each waveform, optimized first if asked, until it stalls."""

    class Settings(LoadSettings):
        """Settings of the sweep."""

        waveforms: tuple[Waveform, ...] = Field(min_length=1, description="One after another.")

    def __init__(self, settings: Any) -> None:
        self._settings = settings
        self._points = LoadPoints(settings)

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most that every waveform may need."""
        subjects = self._subjects(setup)
        return [planned for one in subjects for planned in self._points.planned(setup, one)]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Sweep waveform after waveform; return the contract's `load_sweep` result."""
        swept = [self._points.sweep(bench, one) for one in self._subjects(bench.setup)]
        return result("load_sweep", self._settings, swept)

    def _subjects(self, setup: Setup) -> list[Subject]:
        waveforms = self._settings.waveforms
        tables = nominal_tables(setup, waveforms)
        return [
            Subject(Path(waveform.trajectory).stem, waveform, table)
            for waveform, table in zip(waveforms, tables, strict=True)
        ]
