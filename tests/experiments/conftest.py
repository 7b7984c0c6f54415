"""Shipped recipes, run through the engine on their simulated benches."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest

from labdrive.engine.discovery import discover
from labdrive.engine.plan import Prepared, prepare
from labdrive.engine.run import Outcome, run
from labdrive.model.motion import Motion
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.recipe.load import load
from labdrive.store.run_folder import RunFolder

RECIPES = Path(__file__).parents[2] / "recipes"


@dataclass
class Ran:
    """A run that is done, and what it ran on."""

    prepared: Prepared
    outcome: Outcome

    @property
    def result(self):
        return self.outcome.result

    def raw(self, entry, sensor="interferometer"):
        """Return phase and reading of a result entry's recording."""
        with h5py.File(self.outcome.folder / entry["recording"]) as file:
            return file["phase"][:], file[sensor][:]

    def truth_rms(self, iteration):
        """Return the rms [m] of the true periodic error, all harmonics that the table can hold."""
        columns = RunFolder(self.outcome.folder).read_table(f"iteration-{iteration:02d}")
        channels = [
            Channel(name[:-2], "V", np.array(column))
            for name, column in columns.items()
            if name.endswith("_V")
        ]
        table, motion = WaveformTable(tuple(channels)), Motion(4, 256, 2.0)
        _, position = self.prepared.devices.links["plant"].truth(table, motion)
        step = (position[-1] - position[0]) / motion.periods
        cycles = np.arange(len(position) - 1) / table.length
        error = (position[:-1] - step * cycles).reshape(motion.periods, -1).mean(axis=0)
        return error.std()


@pytest.fixture
def ran(tmp_path):
    """Run a shipped recipe with overrides of fields, on its own bench or another."""
    host = discover()

    def run_recipe(name, *overrides, bench=None):
        prepared = prepare(load(RECIPES / name, host.plugins, bench, overrides), host.plugins)
        outcome = run(prepared, host, tmp_path / "runs", lambda _: None)
        assert outcome.error is None
        return Ran(prepared, outcome)

    run_recipe.recipes = RECIPES
    return run_recipe
