"""Plugins made up for these tests: enough settings of every sort to be wrong about."""

from types import SimpleNamespace
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field

from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.plugin_set import BrokenPlugin, PluginSet
from labdrive.interfaces.quantities import AnyQuantity, Force, InputFile, Length, Time
from labdrive.interfaces.settings import PluginSlot, Settings
from labdrive.interfaces.waveform import Waveform


class Fourier(Settings):
    """Corrects harmonics."""

    estimator: Literal["exact", "paper"] = "exact"
    gain: float = Field(default=1.0, gt=0, le=1)


class Bisect(Settings):
    """Halves intervals."""

    steps: int = 3


class Stop(Settings):
    """When to stop."""

    max_iterations: int = Field(default=8, ge=1)


class Optimize(Settings):
    """Optimizes."""

    waveform: Waveform | None = None
    motion: MotionSettings
    sensor: str
    optimizer: Annotated[Settings, PluginSlot("optimizers")]
    fallback: Annotated[Settings | None, PluginSlot("optimizers")] = None
    stop: Stop = Field(default_factory=Stop)
    loads: list[Force] = Field(default_factory=list)
    stages: list[Stop] = Field(default_factory=list)


class Survey(Settings):
    """Looks around."""

    quick: bool = False


class Stage(Settings):
    """A stage."""

    pitch: Length = Field(default=1e-3, gt=0)
    delay: Time | None = None


class Ruler(BaseModel):
    """A ruler whose author did not ask for strictness."""

    file: InputFile | None = None
    scale: AnyQuantity = AnyQuantity(0.5, "rad")


class Bus(Settings):
    """A bus."""

    port: str = "can0"


def carrying(settings):
    return SimpleNamespace(Settings=settings)


@pytest.fixture
def plugins():
    return PluginSet(
        links={"bus": carrying(Bus)},
        actuators={"stage": carrying(Stage), "slide": carrying(Stage)},
        sensors={"ruler": carrying(Ruler)},
        optimizers={"fourier": carrying(Fourier), "bisect": carrying(Bisect)},
        experiments={"optimize": carrying(Optimize), "survey": carrying(Survey)},
        broken=(BrokenPlugin("acme", "labdrive-acme 1.2", "ImportError: no module acme_sdk"),),
    )


RECIPE = """\
kind: optimize
bench: bench.yaml
motion: {periods: 4, period_rate: 2 Hz}
sensor: ruler
optimizer: {use: fourier}
"""

BENCH = """\
actuators:
  x: {plugin: stage, pitch: 5 um}
sensors:
  ruler: {plugin: ruler}
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write a recipe and a bench where the test runs; what is not given is good."""
    monkeypatch.chdir(tmp_path)

    def written(recipe=RECIPE, bench=BENCH):
        (tmp_path / "recipe.yaml").write_text(recipe, encoding="utf-8")
        (tmp_path / "bench.yaml").write_text(bench, encoding="utf-8")
        return "recipe.yaml"

    return written


@pytest.fixture
def good_recipe():
    return RECIPE


@pytest.fixture
def good_bench():
    return BENCH
