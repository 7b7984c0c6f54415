"""Plugins are found, broken ones named, clashes refused: with real distributions on disk."""

import sys
from pathlib import Path

import pytest

from labdrive.engine.discovery import discover
from labdrive.model.errors import PluginError

SENSOR = """
from pydantic import BaseModel
from labdrive.interfaces import hookimpl

class {cls}:
    class Settings(BaseModel):
        pass

@hookimpl
def labdrive_sensors():
    return {{"{name}": {cls}}}
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch):
    """Put a distribution with one plugin module where Python looks."""
    monkeypatch.syspath_prepend(tmp_path)

    def add(distribution: str, module: str, source: str) -> None:
        monkeypatch.delitem(sys.modules, module, raising=False)
        (tmp_path / f"{module}.py").write_text(source)
        info = tmp_path / f"{distribution}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.2\n"
        )
        (info / "entry_points.txt").write_text(f"[labdrive]\n{module} = {module}\n")

    return add


def test_bundled_plugins_are_found_through_the_entry_points():
    plugins = discover().plugins
    assert {"optimize", "characterize"} <= set(plugins.experiments)
    assert {"sim-interferometer", "recording"} <= set(plugins.sensors)
    assert "fourier" in plugins.optimizers
    assert plugins.origin["optimizers", "fourier"].startswith("labdrive ")
    assert plugins.broken == ()


def test_a_third_partys_plugin_stands_beside_the_bundled_ones(install):
    install("thermo", "thermo_plugin", SENSOR.format(cls="Pt100", name="pt100"))
    plugins = discover().plugins
    assert plugins.sensors["pt100"].__name__ == "Pt100"
    assert plugins.origin["sensors", "pt100"] == "thermo 1.2"
    assert "recording" in plugins.sensors


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("import no_such_driver", "No module named 'no_such_driver'"),
        ("raise SystemError('no licence dongle')", "no licence dongle"),
        (SENSOR.format(cls="A", name="a").replace("(BaseModel)", ""), "pydantic model"),
        (
            SENSOR.format(cls="B", name="b").replace("labdrive_sensors", "labdrive_sensor"),
            "labdrive_sensor",
        ),
        ("def broken(:", "invalid syntax"),
    ],
    ids=["import", "raises", "settings", "hook name", "syntax"],
)
def test_a_broken_plugin_is_named_and_stops_nothing_else(install, source, said):
    install("gadget", "gadget_plugin", source)
    plugins = discover().plugins
    (broken,) = plugins.broken
    assert broken.name == "gadget_plugin"
    assert broken.distribution == "gadget 1.2"
    assert said in broken.error
    assert "fourier" in plugins.optimizers


def test_a_hook_that_raises_is_named(install):
    source = SENSOR.format(cls="D", name="d").replace("return", "raise OSError('no bus');")
    install("gizmo", "gizmo_plugin", source)
    plugins = discover().plugins
    assert [b.error for b in plugins.broken] == ["OSError: no bus"]


def test_two_plugins_of_one_name_are_an_error_that_names_both_distributions(install):
    install("thermo", "thermo_plugin", SENSOR.format(cls="Pt100", name="probe"))
    install("hygro", "hygro_plugin", SENSOR.format(cls="Sht40", name="probe"))
    with pytest.raises(PluginError, match=r"'probe'.*sensors") as raised:
        discover()
    assert "thermo 1.2" in str(raised.value)
    assert "hygro 1.2" in str(raised.value)


def test_two_modules_of_one_entry_point_name_are_both_registered(install, tmp_path):
    install("thermo", "probe_a", SENSOR.format(cls="A", name="probe-a"))
    install("hygro", "probe_b", SENSOR.format(cls="B", name="probe-b"))
    for info in tmp_path.glob("*.dist-info/entry_points.txt"):
        info.write_text(
            info.read_text().replace("probe_a =", "probe =").replace("probe_b =", "probe =")
        )
    plugins = discover().plugins
    assert {"probe-a", "probe-b"} <= set(plugins.sensors)
    assert plugins.origin["sensors", "probe-b"] == "hygro 1.2"


def test_a_life_cycle_hook_that_raises_is_logged_and_the_others_are_called(install, caplog):
    hook = (
        "from labdrive.interfaces import hookimpl\n@hookimpl\ndef labdrive_run_started(run):\n    "
    )
    install("bad", "bad_listener", hook + "raise ValueError('deaf')\n")
    install("good", "good_listener", "heard = []\n" + hook + "heard.append(run)\n")
    discover().tell("labdrive_run_started", run=Path("somewhere"))
    import good_listener

    assert good_listener.heard == [Path("somewhere")]
    assert "bad_listener of bad 1.2 failed in labdrive_run_started" in caplog.text
