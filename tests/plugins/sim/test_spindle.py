"""What the lead screw does: its errors where they were put, its backlash when it turns round."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import InputError
from labdrive.model.motion import Direction
from labdrive.model.waveform import TURN
from labdrive_sim.spindle import Spindle
from labdrive_sim.spindle_kernel import turn
from labdrive_sim.spindle_model import Harmonics, Parameters

LEAD = 1e-3
PLAIN = {"screw_error": [], "detent": [], "backlash": "0 um", "friction": "0 N*m"}


def error_harmonics(bench, motion):
    """Return the complex harmonics c_k of position - lead turns = Re sum c_k exp(i k phi) [m]."""
    phase, position = bench.link.truth(bench.drive.nominal_table(None), motion)
    error = (position - LEAD * phase / TURN)[:-1]
    spectrum = 2 * np.fft.rfft(error) / len(error)
    return spectrum[:: motion.periods]


def test_a_perfect_screw_is_straight(spindle, motion):
    bench = spindle(PLAIN)
    phase, position = bench.link.truth(bench.drive.nominal_table(None), motion())
    assert position - position[0] == pytest.approx(LEAD * phase / TURN, abs=1e-15)


def test_the_screws_error_is_where_it_was_put(spindle, motion):
    error = [
        {"order": 1, "amplitude": "3 um", "phase": "0.4 rad"},
        {"order": 4, "amplitude": "0.2 um", "phase": "-60 deg"},
    ]
    found = error_harmonics(spindle(PLAIN | {"screw_error": error}), motion())
    assert found[1] == pytest.approx(3e-6 * np.exp(1j * (0.4 - TURN / 4)), abs=1e-12)
    assert found[4] == pytest.approx(0.2e-6 * np.exp(1j * (-TURN / 6 - TURN / 4)), abs=1e-12)
    assert np.max(np.abs(np.delete(found, [0, 1, 4]))) < 1e-12


@pytest.mark.parametrize("order", [5, 10, 20])
def test_the_detent_pulls_the_motor_by_torque_over_stiffness(spindle, motion, order):
    detent = [{"order": order, "torque": "1 mN*m", "phase": "0 rad"}]
    plant = PLAIN | {"detent": detent, "stiffness": "10 N*m/rad"}
    found = error_harmonics(spindle(plant), motion())
    # angle = commanded - 1e-4 sin(order angle): falls behind where the sine is positive.
    assert found[order] == pytest.approx(1j * 1e-4 * LEAD / TURN, rel=1e-3)


def test_unequal_seeds_draw_other_phases_and_the_same_amplitudes(spindle, motion):
    tight = {"backlash": "0 um", "friction": "0 N*m", "detent": []}
    one, other = (error_harmonics(spindle(tight | {"seed": seed}), motion()) for seed in (1, 2))
    assert abs(one[1]) == pytest.approx(abs(other[1]), rel=1e-9)
    assert abs(one[1] - other[1]) > 1e-8


def test_turning_round_loses_the_backlash_and_the_wind_up(spindle, motion):
    lost = PLAIN | {"backlash": "2 um", "friction": "1 mN*m", "stiffness": "5 N*m/rad"}
    bench = spindle(lost)
    out = bench.record(bench.drive.nominal_table(None), motion(settle_periods=1))[2]
    back = list(bench.play(motion(settle_periods=0, direction=Direction.BACKWARD)))
    home = np.concatenate([reading.value for _, reading in back])
    # Twice the wind-up, 2 * 0.2 mrad, in travel, and the whole backlash.
    expected = 2e-6 + 2 * 0.2e-3 * LEAD / TURN
    assert np.all(home <= out[-1])
    assert home[-1] - out[0] == pytest.approx(expected, abs=1e-12)


def test_a_load_turns_the_motor_back_and_shows_in_the_force(spindle, motion):
    force = {"plugin": "sim-force", "link": "plant", "noise": "0 N"}
    loaded, free = spindle(PLAIN | {"load": "50 N"}), spindle(PLAIN)
    table = free.drive.nominal_table(None)
    sag = free.record(table, motion())[2] - loaded.record(table, motion())[2]
    assert sag == pytest.approx(50 * (LEAD / TURN) ** 2 / 5.0, rel=1e-6)
    sensed = spindle(PLAIN | {"load": "50 N"}, sensor=force).record(table, motion())[2]
    assert np.all(sensed == 50)


def as_written(p, commanded):
    """Return the model's positions by a fixed point and a plain loop."""

    def wave(h, angle):
        turned = np.sin(np.multiply.outer(angle, h.orders) + h.phases) - np.sin(h.phases)
        return turned @ h.amplitudes

    motor = commanded - p.twist
    for _ in range(200):
        motor = commanded - p.twist - wave(p.detent, motor)
    screw = nut = 0.0
    position = []
    for angle in motor:
        screw = min(max(screw, angle - p.wind_up), angle + p.wind_up)
        flank = p.lead * screw / TURN + wave(p.screw_error, np.array(screw))
        nut = min(max(nut, flank - p.backlash / 2), flank + p.backlash / 2)
        position.append(nut)
    return np.array(position)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0, 0.8),
    st.floats(0, 1e-2),
    st.floats(0, 1e-5),
    st.floats(-1e-2, 1e-2),
)
@settings(max_examples=20, deadline=None)
def test_the_compiled_screw_does_what_the_model_says(seed, steepness, wind_up, backlash, twist):
    random = np.random.default_rng(seed)
    orders = np.array([1.0, 5.0, 20.0])
    steep = random.dirichlet(np.ones(3)) * steepness
    drawn = Parameters(
        LEAD,
        Harmonics(orders, 1e-5 * random.random(3), random.uniform(0, TURN, 3)),
        Harmonics(orders, steep / orders, random.uniform(0, TURN, 3)),
        twist,
        wind_up,
        backlash,
    )
    commanded = np.cumsum(random.normal(0, 0.2, 300))
    compiled = turn(drawn, np.zeros(3), commanded)
    assert compiled == pytest.approx(as_written(drawn, commanded), abs=1e-13)


def test_the_table_is_the_phase(spindle):
    (channel,) = spindle().drive.nominal_table(None).channels
    assert (channel.name, channel.unit, channel.advance) == ("angle", "rad", TURN)
    assert channel.samples == pytest.approx(TURN * np.arange(4096) / 4096)


def test_travel_is_the_lead(spindle):
    bench = spindle(PLAIN | {"lead": "2 mm"}, {"lead": "2 mm"})
    assert bench.drive.travel_per_period(bench.drive.nominal_table(None)) == pytest.approx(2e-3)


def test_a_waveform_is_refused(spindle):
    with pytest.raises(InputError, match="waveform: a spindle has no choice of waveform"):
        spindle().drive.nominal_table(Waveform(trajectory="box"))


def test_loading_goes_to_the_nearest_start_without_unwinding(spindle, motion):
    bench = spindle(PLAIN)
    table = bench.drive.nominal_table(None)
    bench.record(table, motion(periods=5))
    angle = bench.link.outputs[0]
    assert angle == pytest.approx(7 * TURN)
    bench.drive.load(table)
    assert bench.link.outputs[0] == pytest.approx(angle)


def test_a_motion_broken_off_goes_on_from_there(spindle, motion):
    bench = spindle(PLAIN, {"speed": 1000})
    bench.drive.load(bench.drive.nominal_table(None))
    chunks = bench.play(motion(periods=50))
    for _ in range(3):
        next(chunks)
    chunks.close()
    here = bench.link.stretch.position[-1]
    position = bench.record(bench.drive.nominal_table(None), motion(settle_periods=0))[2]
    assert abs(position[0] - here) <= LEAD / 2


def test_a_detent_steeper_than_the_motor_is_stiff_is_refused():
    jumping = {"detent": [{"order": 20, "torque": "0.3 N*m"}], "stiffness": "5 N*m/rad"}
    with pytest.raises(ValidationError, match="the motor would jump"):
        Spindle.Settings.model_validate(jumping)
