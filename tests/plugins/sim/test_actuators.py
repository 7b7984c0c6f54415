"""How simulated actuators play: phases, times, chunks, pace, refusals."""

import itertools
import time

import numpy as np
import pytest
from pydantic import ValidationError

from labdrive.interfaces.devices import Acquisition, DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.motion import Direction
from labdrive.model.waveform import TURN
from labdrive_sim.actuators import WalkingActuator
from labdrive_sim.table_player import FAST_CHUNK_STEPS


def every_chunk(bench, motion, table=None):
    bench.drive.load(table or bench.table())
    return list(bench.drive.play(Acquisition(1, motion)))


def outputs_seen(bench):
    """Return a list that takes up what the plant is told from now on."""
    seen, follow = [], bench.link.follow

    def watched(outputs, time, step_s):
        seen.append(outputs)
        follow(outputs, time, step_s)

    bench.link.follow = watched
    return seen


@pytest.mark.parametrize("direction", list(Direction))
@pytest.mark.parametrize("speed", ["fast", 400])
def test_samples_settle_first_and_then_run_from_phase_zero(walking, motion, direction, speed):
    asked = motion(periods=3, direction=direction)
    chunks = every_chunk(walking(actuator={"speed": speed}), asked)
    settling = np.concatenate([chunk.phase for chunk in chunks if chunk.settling])
    recorded = np.concatenate([chunk.phase for chunk in chunks if not chunk.settling])
    m, sign = asked.samples_per_period, direction.sign
    assert settling == pytest.approx(sign * TURN * np.arange(-2 * m, 0) / m)
    assert recorded == pytest.approx(sign * TURN * np.arange(3 * m + 1) / m)
    assert [chunk.settling for chunk in chunks] == sorted(
        (chunk.settling for chunk in chunks), reverse=True
    )


def test_time_runs_from_the_start_of_the_motion_at_the_phase_rate(walking, motion):
    chunks = every_chunk(walking(), motion(periods=3, period_rate_hz=5.0))
    times = np.concatenate([chunk.time for chunk in chunks])
    assert times == pytest.approx(np.arange(5 * 64 + 1) / 64 / 5.0)


def test_chunks_are_bounded_and_none_is_empty(walking, motion):
    for speed in ("fast", 5e5):
        bench = walking(actuator={"speed": speed})
        bench.drive.load(bench.table())
        for chunk in bench.drive.play(Acquisition(1, motion(periods=40, samples_per_period=16))):
            assert len(chunk.phase) >= 1
            assert len(bench.link.stretch.time) <= FAST_CHUNK_STEPS


def test_where_the_rod_goes_does_not_depend_on_how_it_is_sampled(walking, motion):
    coarse, fine = walking(), walking()
    few = coarse.record(coarse.table(), motion(samples_per_period=16))[2]
    many = fine.record(fine.table(), motion(samples_per_period=4096))[2]
    assert np.array_equal(few, many[::256])


def test_at_a_given_speed_the_clock_on_the_wall_is_kept(walking, motion):
    bench = walking(actuator={"speed": 2})
    bench.link.connect()
    bench.drive.load(bench.table())
    started = time.monotonic()
    arrivals = [
        (time.monotonic() - started, samples.time[-1])
        for samples in bench.drive.play(Acquisition(1, motion(periods=1, settle_periods=0)))
    ]
    wall, simulated = np.transpose(arrivals)
    assert len(arrivals) >= 5
    assert np.all(wall >= simulated / 2 - 1e-3)
    assert wall[-1] < 0.25 + 0.3


def test_as_fast_as_possible_nobody_waits(walking, motion):
    bench = walking()
    bench.link.connect()
    started = time.monotonic()
    every_chunk(bench, motion(periods=2, period_rate_hz=0.01))
    assert time.monotonic() - started < 5


def test_samples_that_fall_between_entries_are_refused_before_anything_moves(walking, motion):
    bench = walking()
    bench.drive.load(bench.table())
    before = bench.link.stretch
    with pytest.raises(InputError) as refusal:
        bench.drive.play(Acquisition(1, motion(samples_per_period=48)))
    assert str(refusal.value) == (
        "motion.samples_per_period: does not divide the 4096 entries of the table; take 32 or 64, "
        "or a table_length of 4080 (got 48)"
    )
    assert bench.link.stretch is before


def test_a_table_of_that_length_can_be_clocked(walking, motion):
    bench = walking(actuator={"table_length": 4080})
    assert len(bench.record(bench.table(), motion(samples_per_period=48))[0]) == 97


def test_playing_nothing_is_an_error(walking, motion):
    with pytest.raises(DeviceError, match="load one first"):
        walking().drive.play(Acquisition(1, motion()))


def test_a_table_of_another_length_is_an_error(walking):
    table = walking(actuator={"table_length": 1024}).table()
    with pytest.raises(DeviceError, match="4096 entries, not of 1024"):
        walking().drive.load(table)


def test_loading_ramps_the_voltages(walking):
    bench = walking()
    bench.drive.load(bench.table("box"))
    before, seen, table = bench.link.outputs, outputs_seen(bench), bench.table("triangle")
    bench.drive.load(table)
    (ramp,) = seen
    assert np.max(np.abs(np.diff(np.vstack([before, ramp]), axis=0))) < 0.1
    assert ramp[-1] == pytest.approx([channel.samples[0] for channel in table.channels])


@pytest.mark.parametrize("bring", ["make_safe", "reference"])
def test_safe_and_referenced_is_zero_volts_however_often(walking, motion, bring):
    bench = walking()
    getattr(bench.drive, bring)()
    assert np.all(bench.link.outputs == 0)
    bench.record(bench.table(), motion())
    assert np.any(bench.link.outputs != 0)
    for _ in range(2):
        getattr(bench.drive, bring)()
        assert np.all(bench.link.outputs == 0)


def test_a_motion_that_is_broken_off_goes_no_further(walking, motion):
    bench = walking(actuator={"speed": 200})
    bench.drive.load(bench.table())
    chunks = bench.drive.play(Acquisition(1, motion(periods=100)))
    list(itertools.islice(chunks, 2))
    chunks.close()
    halted = bench.link.outputs
    time.sleep(0.1)
    assert bench.link.outputs is halted


def test_the_nominal_table_fills_the_voltage_range(walking):
    table = walking().table("triangle")
    samples = np.stack([channel.samples for channel in table.channels])
    assert samples.min() == pytest.approx(0, abs=1e-9)
    assert samples.max() == pytest.approx(48)
    assert [channel.name for channel in table.channels] == ["U0", "U1", "U2", "U3"]


def test_the_step_is_foretold_within_the_give_of_the_drive(walking, motion):
    bench = walking()
    table = bench.table()
    position = bench.record(table, motion())[2]
    foretold = bench.drive.travel_per_period(table)
    assert (position[-1] - position[0]) / 2 == pytest.approx(foretold, rel=0.2)


def test_without_a_voltage_range_there_is_no_table(walking):
    bench = walking()
    context = DeviceContext("drive", Limits(), {"plant": bench.link})
    bare = WalkingActuator(WalkingActuator.Settings(link="plant"), context)
    with pytest.raises(InputError, match=r"limits\.voltage"):
        bare.nominal_table(Waveform(trajectory="box"))


def test_without_a_waveform_there_is_no_table(walking):
    with pytest.raises(InputError, match="waveform: missing"):
        walking().drive.nominal_table(None)


def test_a_link_that_takes_other_outputs_is_refused(spindle):
    with pytest.raises(InputError) as refusal:
        spindle(actuator={"plugin": "sim-walking-actuator"})
    assert str(refusal.value) == (
        "actuators.drive.link: must name a simulated plant that takes 4 outputs; the bench has "
        "plant (got plant)"
    )


def test_a_sensor_on_something_else_is_refused(walking):
    with pytest.raises(InputError, match=r"sensors\.probe\.link: must name a simulated plant"):
        walking(sensor={"link": "plnt"})


@pytest.mark.parametrize("speed", [0, -1, "slow"])
def test_speeds_that_are_none_are_refused(walking, speed):
    with pytest.raises(ValidationError):
        walking(actuator={"speed": speed})


def test_every_entry_is_played_in_turn_and_the_last_cycle_closed(walking, motion):
    bench = walking({"amplifier_time": "0 s"}, {"table_length": 64})
    table = bench.table()
    bench.drive.load(table)
    played = outputs_seen(bench)
    backward = motion(periods=2, settle_periods=1, direction=Direction.BACKWARD)
    list(bench.drive.play(Acquisition(1, backward)))
    cycle = np.stack([channel.samples for channel in table.channels], axis=1)
    expected = np.concatenate([cycle[:1], cycle[::-1], cycle[::-1], cycle[::-1]])
    assert np.array_equal(np.concatenate(played), expected)
