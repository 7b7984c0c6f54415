"""`characterize_spindle` on the simulated lead screw: what it finds, and what it refuses."""

import pytest

from labdrive.model.errors import InputError

SIM = ("motion.samples_per_period=64", "motion.period_rate=2 Hz", "optimizer.estimator=exact")


@pytest.fixture
def characterized(ran, tmp_path):
    """Characterize a screw with a backlash, and without friction unless given."""

    def run(backlash, *overrides, friction="0 N*m"):
        text = (ran.recipes / "benches" / "spindle-sim.yaml").read_text()
        plant = f"seed: 1\n    backlash: {backlash}\n    friction: {friction}"
        bench = tmp_path / "bench.yaml"
        bench.write_text(text.replace("seed: 1", plant))
        return ran("characterize_spindle.yaml", *SIM, "runs=2", *overrides, bench=bench).result

    return run


@pytest.mark.parametrize("backlash", ["0 um", "2 um", "12 um"])
def test_the_backlash_is_the_plants_and_in_neither_map(characterized, backlash):
    result = characterized(backlash)
    micrometres = float(backlash.split()[0])
    assert result["backlash"]["value"] == pytest.approx(1e-6 * micrometres, rel=1e-3, abs=1e-9)
    for found in result["directions"].values():
        assert found["before"]["periodic_error"]["rms"] == pytest.approx(1.885e-6, rel=0.01)
        assert found["improvement"] > 20


def test_what_friction_winds_up_is_part_of_it(characterized):
    """Twice friction over stiffness, 0.4 mrad, of a lead of 1 mm: 64 nm."""
    result = characterized("2 um", "correct=false", friction="1 mN*m")
    assert result["backlash"]["value"] == pytest.approx(2.0637e-6, rel=1e-3)
    assert all("map" not in found for found in result["directions"].values())


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("motion.periods=2", "must be 3 or more"),
        ("motion.settle_periods=0", "backlash is taken up"),
        ("motion.direction=backward", "both directions are walked"),
        ("nested.electrical_turn=1", "2 cycles a revolution or more"),
        ("runs=1", "2 or more"),
    ],
)
def test_what_cannot_be_compared_is_refused(ran, override, said):
    bench = ran.recipes / "benches" / "spindle-sim.yaml"
    with pytest.raises(InputError, match=said):
        ran("characterize_spindle.yaml", *SIM, override, bench=bench)
