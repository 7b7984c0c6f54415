"""Legs of the simulated drive: identified, written to a file, included by others."""

import json

import numpy as np
import pytest

from labdrive.interfaces.legs_file import read_legs
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError

QUICK = ("motion.periods=8",)


@pytest.fixture
def with_plant(ran, tmp_path):
    """Return a copy of a shipped bench with other settings of its plant."""

    def bench(name, *settings):
        text = (ran.recipes / "benches" / name).read_text()
        added = "\n".join(["    plugin: sim-walking-drive", *(f"    {line}" for line in settings)])
        path = tmp_path / name
        assert "    plugin: sim-walking-drive" in text
        path.write_text(text.replace("    plugin: sim-walking-drive", added))
        return path

    return bench


def test_the_matrix_is_the_plants_and_the_loop_is_told(ran):
    result = ran("identify_legs.yaml", *QUICK).result
    (m11, m12), (m21, m22) = result["matrix"]
    assert (m11, m21) == (-m12, m22)
    # 2.5 % mismatch of the groups; a leaf spring that takes 2 % of y.
    assert m11 == pytest.approx(0.036e-6, rel=0.06)
    assert m21 == pytest.approx(0.025e-6, rel=0.06)
    assert result["hysteresis"] == max(result["loop_width"].values())
    assert 0.08 < result["hysteresis"] < 0.11
    assert min(result["r_squared"].values()) > 0.98


@pytest.mark.parametrize("geometry", ["free", "stack", "clamp_shear"])
def test_every_geometry_can_be_asked_for(ran, geometry):
    result = ran("identify_legs.yaml", *QUICK, f"geometry={geometry}").result
    if geometry == "clamp_shear":  # which these legs are not
        assert result["matrix"][0][0] == result["matrix"][1][1] == 0
        assert max(result["r_squared"].values()) < 0.7
    else:
        assert min(result["r_squared"].values()) > 0.98
    assert ("stack" in result) == (geometry == "stack")


def test_a_wider_loop_fits_worse(ran, with_plant):
    wide = with_plant("lt40-sim-legs.yaml", "loop_width: 0.18")
    result = ran("identify_legs.yaml", *QUICK, bench=wide).result
    assert result["hysteresis"] > 0.12
    assert min(result["r_squared"].values()) < 0.98


def test_an_actuator_takes_the_file_for_its_leg_model(ran, with_plant, tmp_path):
    done = ran("identify_legs.yaml", *QUICK)
    path = done.outcome.folder / done.result["legs_file"]
    assert json.loads(path.read_text())["run"] == done.outcome.folder.name
    bench = (ran.recipes / "benches" / "lt40-sim.yaml").read_text()
    included = tmp_path / "included.yaml"
    own = "x_per_volt: 0.036 um/V, y_per_volt: 0.025 um/V"
    assert own in bench
    included.write_text(bench.replace(own, f"legs: {path}"))
    quick = ("motion.periods=4",)
    tips = {}
    for name, file in (("assumed", None), ("identified", included)):
        setup = ran("characterize.yaml", *quick, bench=file).prepared.devices
        tips[name] = setup.tips(setup.nominal_table(Waveform(trajectory="box")))
    for axis, m, assumed in (("x", 0, 0.036e-6), ("y", 1, 0.025e-6)):
        strokes = [np.ptp(tips[name][f"{axis}_A"]) for name in ("assumed", "identified")]
        identified = done.result["matrix"][m][0]
        assert strokes[1] / strokes[0] == pytest.approx(identified / assumed)


def test_the_hysteresis_aware_start_begins_with_less_error_where_the_loop_makes_it(ran):
    legs = ran("identify_legs.yaml", *QUICK)
    path = legs.outcome.folder / legs.result["legs_file"]
    quick = ("waveform.trajectory=triangle", "motion.periods=8", "stop.max_iterations=1")
    aware = ("optimizer.start=inverse_hysteresis", f"optimizer.legs={path}")
    errors = [
        ran("optimize.yaml", *quick, *more).result["iterations"][0]["periodic_error"]["rms"]
        for more in ((), aware)
    ]
    assert errors[1] < 0.85 * errors[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "legs.json"),
        ('{"run": "r"}', "geometry"),
        ('{"m11": "x"}', "m11"),
    ],
)
def test_a_damaged_file_is_told_by_its_field(tmp_path, text, says):
    path = tmp_path / "legs.json"
    path.write_text(text)
    with pytest.raises(InputError, match=says) as error:
        read_legs(path)
    assert "legs.json" in str(error.value)
