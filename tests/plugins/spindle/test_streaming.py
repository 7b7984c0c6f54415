"""Streamed motions of `spindle-canopen`: how they begin and end, and what is not let pass."""

import time
from contextlib import closing
from threading import Timer

import can
import numpy as np
import pytest

from labdrive.interfaces.devices import Acquisition
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Direction, Motion
from labdrive_sim.canopen_devices import CanopenDevices, CanopenDrive, CanopenEncoder
from labdrive_sim.drive_axis import CYCLIC_POSITION, ENABLED, PROFILE_POSITION, Axis
from labdrive_sim.spindle import Spindle

from .conftest import context

TURN_COUNTS = 1 << 20
SYNC_S = 2e-3
RATE_HZ = 10.0
# 500 SYNCs a second.
MOTION = Motion(periods=3, samples_per_period=50, period_rate_hz=RATE_HZ, settle_periods=2)
PLAIN = {"screw_error": [], "detent": [], "backlash": "0 um", "friction": "0 N*m"}


@pytest.fixture
def ready(can_bench):
    """Return a bench and its connected actuator with the nominal table loaded."""

    def make(**settings):
        bench = can_bench(PLAIN)
        bench.axis.settings.lag_s = 1e-5  # the motor is where the set-points are
        actuator = bench.actuator(**settings)
        actuator.connect()
        actuator.load(actuator.nominal_table(None))
        return bench, actuator

    return make


@pytest.fixture
def heard():
    """Have a bench's drive note something at each SYNC; return the list of it."""

    def listen(bench, what):
        noted, on_sync = [what(bench)], bench.drive.node.on_sync

        def hear():
            on_sync()
            noted.append(what(bench))

        bench.drive.node.on_sync = hear
        return noted

    return listen


def turns(bench):
    return bench.axis.demand / TURN_COUNTS


def carriage(bench):
    return float(bench.axis.plant.stretch.position[-1])


def speeds(positions):
    """Return revolutions a second from SYNC to SYNC."""
    return np.diff(positions) / SYNC_S


@pytest.mark.parametrize("direction", Direction)
def test_the_speed_rises_from_nothing_and_falls_to_it_on_the_ramp(ready, heard, direction):
    bench, actuator = ready(ramp="0.1 s")
    positions = heard(bench, turns)
    list(actuator.play(Acquisition(1, Motion(3, 50, RATE_HZ, 2, direction))))
    steepest = np.max(np.abs(np.diff(speeds(positions), prepend=0.0, append=0.0)))
    assert steepest < 1.2 * RATE_HZ * SYNC_S / 0.1
    assert np.max(np.abs(speeds(positions))) == pytest.approx(RATE_HZ, rel=0.01)


def test_a_halt_in_the_run_up_slows_down_from_the_speed_reached(ready, heard):
    bench, actuator = ready(ramp="1 s", turns={"min": -20, "max": 20})
    positions = heard(bench, turns)
    with closing(actuator.play(Acquisition(1, MOTION))) as chunks:
        for _ in chunks:
            if speeds(positions)[-1] > 3.0:
                break
        halted = len(positions)
    until, after = speeds(positions[:halted]), speeds(positions[halted - 1 :])
    assert until.max() < 6.0
    assert after.max() < until.max() + 0.5  # the thread notices a cycle or so later
    assert after[-1] == 0.0
    # From 0.3 of the rate, a bit more than 0.3 of the ramp.
    assert np.count_nonzero(after) * SYNC_S < 0.6


@pytest.mark.parametrize("direction", Direction)
def test_the_carriage_goes_nowhere_unread(ready, heard, direction):
    """So that the limits of the bench hold all the way: to run up, to settle, and to run out."""
    bench, actuator = ready(ramp="0.5 s")
    encoder = bench.encoder()
    encoder.connect()
    reached = heard(bench, carriage)
    read, settling = [], []
    for samples in actuator.play(Acquisition(1, Motion(3, 50, RATE_HZ, 1, direction))):
        reading = encoder.read(samples)
        assert len(reading.value) == len(samples.phase)
        assert len(samples.phase) * SYNC_S <= 0.06
        read.extend(reading.value)
        settling.append(samples.settling)
    # 2.5 turns of 1 mm to either side.
    assert np.ptp(read) == pytest.approx(4e-3 + 5e-3, abs=0.1e-3)
    assert min(read) == pytest.approx(min(reached), abs=5e-6)
    assert max(read) == pytest.approx(max(reached), abs=5e-6)
    recorded = [i for i, unrecorded in enumerate(settling) if not unrecorded]
    assert np.all(np.diff(recorded) == 1)


def test_the_next_motion_begins_where_this_one_ended_however_far_it_ran_on(ready):
    """2.5 turns to slow down: the way back passes the same turns."""
    bench, actuator = ready(ramp="0.5 s")
    table = actuator.nominal_table(None)
    for direction, end in ((Direction.FORWARD, 5), (Direction.BACKWARD, 0)):
        list(actuator.play(Acquisition(1, Motion(3, 50, RATE_HZ, 2, direction))))
        beyond = 2.5 * direction.sign
        assert turns(bench) == pytest.approx(end + beyond, abs=0.01)
        actuator.load(table)
        assert turns(bench) == pytest.approx(end, abs=0.01)


def test_a_motion_may_come_to_rest_at_the_very_end_of_the_range(ready, heard):
    """What set-points run ahead by is not added to it."""
    bench, actuator = ready(ramp="0.1 s", turns={"min": -0.5001, "max": 5.5001})
    bench.axis.settings.lag_s = 2e-3  # 0.02 revolutions at full rate
    positions = heard(bench, turns)
    list(actuator.play(Acquisition(1, MOTION)))
    assert min(positions) == pytest.approx(-0.5, abs=1e-4)
    assert positions[-1] == pytest.approx(5.5, abs=1e-4)


def test_a_set_point_that_the_drive_holds_back_is_told(ready):
    bench, actuator = ready()
    bench.axis.limits = (-TURN_COUNTS, TURN_COUNTS)  # a narrower one of its own
    with pytest.raises(DeviceError, match=r"statusword bit 11.*607Dh"):
        list(actuator.play(Acquisition(1, MOTION)))


def test_two_streams_on_one_bus_are_refused(ready):
    bench, actuator = ready()
    axis = Axis(Spindle(Spindle.Settings(), context("plant")))
    drive, encoder = CanopenDrive(axis, 8), CanopenEncoder(axis, 9, 1e-9, 0.5e-9, 1)
    devices = CanopenDevices(drive, encoder, can.Bus(bench.bus.settings.channel, "virtual"))
    other = bench.actuator(node=8)
    other.connect()
    other.load(other.nominal_table(None))
    with closing(actuator.play(Acquisition(1, MOTION))) as chunks:
        next(chunks)
        with pytest.raises(
            DeviceError, match=r"would come twice; give each drive a bus of its own"
        ):
            next(other.play(Acquisition(1, MOTION)))
    for one in (other, actuator):  # one after the other
        list(one.play(Acquisition(1, MOTION)))
    other.close()
    devices.close()


def test_another_sender_of_the_sync_is_told(ready):
    bench, actuator = ready()
    other = can.Bus(bench.bus.settings.channel, "virtual")
    chunks = actuator.play(Acquisition(1, MOTION))
    next(chunks)
    other.send(can.Message(arbitration_id=0x80, is_extended_id=False))
    with pytest.raises(DeviceError, match=r"another device sends the SYNC.*1005h"):
        list(chunks)
    other.shutdown()
    actuator.load(actuator.nominal_table(None))
    list(actuator.play(Acquisition(1, MOTION)))


def test_a_drive_may_take_a_few_cycles_to_follow(ready, heard, monkeypatch):
    bench, actuator = ready()
    syncs = heard(bench, turns)
    read = bench.drive.node._read

    def ignoring_at_first(index, sub):
        value = read(index, sub)
        early = index == 0x6041 and bench.axis.mode == CYCLIC_POSITION and len(syncs) < 4
        return value & ~(1 << 12) if early else value

    monkeypatch.setattr(bench.drive.node, "_read", ignoring_at_first)
    list(actuator.play(Acquisition(1, MOTION)))


def test_a_drive_that_never_follows_is_told_before_it_is_due_to_move(ready, heard, monkeypatch):
    bench, actuator = ready()
    positions, read = heard(bench, turns), bench.drive.node._read

    def ignoring(index, sub):
        value = read(index, sub)
        return value & ~(1 << 12) if index == 0x6041 and bench.axis.mode == 8 else value

    monkeypatch.setattr(bench.drive.node, "_read", ignoring)
    with pytest.raises(DeviceError, match=r"ignores the set-points \(statusword bit 12\)"):
        list(actuator.play(Acquisition(1, MOTION)))
    assert np.ptp(positions) < 0.01


def test_whoever_is_slow_to_take_the_samples_leaves_no_drive_without_its_sync(ready):
    bench, actuator = ready()
    for samples in actuator.play(Acquisition(1, MOTION)):
        if samples.phase[-1] > 2.5 * 2 * np.pi:
            time.sleep(0.8)  # longer than a drive that follows set-points waits for the SYNC
            assert bench.axis.mode == PROFILE_POSITION
    assert bench.axis.state == ENABLED


@pytest.mark.parametrize("halted", [False, True])
def test_the_sync_goes_on_until_the_drive_has_left_the_cyclic_mode(ready, monkeypatch, halted):
    bench, actuator = ready()
    take = bench.axis.set_mode

    def take_late(mode):
        if bench.axis.mode == CYCLIC_POSITION:
            Timer(0.7, take, [mode]).start()
        else:
            take(mode)

    monkeypatch.setattr(bench.axis, "set_mode", take_late)
    with closing(actuator.play(Acquisition(1, MOTION))) as chunks:
        for _ in chunks:
            if halted:
                break
    assert bench.axis.mode == PROFILE_POSITION
    assert bench.axis.state == ENABLED


@pytest.mark.parametrize("then", ["load", "play", "turn_to"])
def test_a_drive_that_restarted_between_motions_is_not_moved(ready, then):
    bench, actuator = ready()
    list(actuator.play(Acquisition(1, MOTION)))
    bench.drive.node.restart()
    time.sleep(0.05)
    before = bench.axis.demand
    move = {
        "load": lambda: actuator.load(actuator.nominal_table(None)),
        "play": lambda: next(actuator.play(Acquisition(2, MOTION))),
        "turn_to": lambda: actuator.turn_to(1.0),
    }[then]
    with pytest.raises(DeviceError, match="did it restart"):
        move()
    assert bench.axis.demand == before
