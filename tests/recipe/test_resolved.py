import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from labdrive.recipe.load import load


def reloaded(loaded, folder, plugins):
    """Load again what was resolved, from another folder."""
    (folder / "recipe.yaml").write_text(loaded.resolved_recipe(), encoding="utf-8")
    (folder / "bench.yaml").write_text(loaded.resolved_bench(), encoding="utf-8")
    return load(folder / "recipe.yaml", plugins, bench=folder / "bench.yaml")


def test_every_default_is_filled_in_as_text(write, plugins, tmp_path):
    loaded = load(write(), plugins)
    assert loaded.resolved_recipe() == (
        f"""\
kind: optimize
title: ""
bench: {tmp_path}/bench.yaml
actuator: null
seed: 1
waveform: null
motion:
  periods: 4
  samples_per_period: 256
  period_rate: 2 Hz
  settle_periods: 2
  direction: forward
  return_to_start: true
sensor: ruler
optimizer:
  use: fourier
  estimator: exact
  gain: 1.0
fallback: null
stop:
  max_iterations: 8
loads: []
stages: []
"""
    )
    assert loaded.resolved_bench() == (
        """\
links: {}
actuators:
  x:
    plugin: stage
    pitch: 5 um
    delay: null
sensors:
  ruler:
    plugin: ruler
    file: null
    scale: 500 mrad
load: null
limits:
  voltage: null
  slew: null
  amplifier: null
  travel: null
  force: null
  period_rate: null
  silence: 30 s
  lowest_resonance: null
interlocks: []
"""
    )


def test_files_are_found_from_anywhere(write, plugins, tmp_path, good_bench):
    (tmp_path / "data.csv").touch()
    bench = good_bench.replace("plugin: ruler}", "plugin: ruler, file: data.csv}")
    bench += "limits: {travel: {min: -90 deg, max: 1 rev}}\n"
    loaded = load(write(bench=bench), plugins)
    run = tmp_path / "runs"
    run.mkdir()
    again = reloaded(loaded, run, plugins)
    assert again.bench.model_dump() == loaded.bench.model_dump()
    assert again.bench.sensors["ruler"].file == tmp_path / "data.csv"
    assert load(run / "recipe.yaml", plugins).recipe.bench == str(tmp_path / "bench.yaml")


names = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
positive = st.floats(min_value=1e-200, max_value=1e200)


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40
)
@given(
    title=names, rate=positive, pitch=positive, loads=st.lists(positive), gain=st.floats(1e-9, 1)
)
def test_settings_survive(write, plugins, tmp_path, title, rate, pitch, loads, gain):
    values = {"title": title, "motion.period_rate": f"{rate!r} Hz", "optimizer.gain": repr(gain)}
    escaped = "".join(f"\\U{ord(character):08X}" for character in title)
    values["title"] = f'"{escaped}"'
    values["loads"] = "[" + ", ".join(f"{load!r} N" for load in loads) + "]"
    overrides = [f"{field}={value}" for field, value in values.items()]
    slide = f"{{plugin: slide, pitch: {pitch!r} m}}"
    write(bench=f"actuators: {{x: {slide}}}\nsensors: {{r: {{plugin: ruler}}}}\n")
    loaded = load("recipe.yaml", plugins, overrides=overrides)
    (tmp_path / "run").mkdir(exist_ok=True)
    again = reloaded(loaded, tmp_path / "run", plugins)
    assert loaded.recipe.title == title
    assert loaded.recipe.loads == pytest.approx(loads, rel=0, abs=0)
    assert {**again.recipe.model_dump(), "bench": ""} == {**loaded.recipe.model_dump(), "bench": ""}
    assert again.bench.model_dump() == loaded.bench.model_dump()
