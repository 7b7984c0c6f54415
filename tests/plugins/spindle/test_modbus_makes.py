"""Leadshine and IAI: status registers that lag and tell of earlier motions, power that is lost."""

import argparse
import re
import time
from threading import Timer

import pytest

from labdrive.interfaces.devices import Acquisition
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN
from labdrive_sim.drive_axis import DISABLED, ENABLED, Axis, AxisSettings
from labdrive_sim.modbus_drive import ModbusDevice
from labdrive_sim.spindle import Spindle

from .conftest import context
from .test_modbus import COUNTS, actuator_on, link  # noqa: F401 a fixture

LAG_S = 0.010
MAKES = ["leadshine", "iai"]


@pytest.fixture
def bench(link):  # noqa: F811
    """Return an emulated drive of this process, over a real socket, and connections to it."""
    devices = []

    def build(kind, plant=None, speed=1):
        spindle = Spindle(Spindle.Settings.model_validate(plant or {}), context("plant"))
        axis = Axis(spindle, AxisSettings(counts_per_turn=COUNTS))
        options = argparse.Namespace(
            map=kind, unit=1, speed=speed, resolution=1e-9, noise=0.0, seed=1, status_lag=LAG_S
        )
        devices.append(ModbusDevice(axis, options))
        port = devices[-1].server.serve_tcp("127.0.0.1", 0)

        def connect(**settings):
            bus = link({"host": "127.0.0.1", "port": port})
            return actuator_on(bus, kind, **settings)

        return axis, connect

    yield build
    for device in devices:
        device.close()


def turns(axis):
    """Return where the motor stands, in revolutions from where it was switched on."""
    with axis.lock:
        return axis.plant.motor_angle / TURN


@pytest.mark.parametrize("kind", MAKES)
def test_homing_is_over_when_the_home_is_found_in_each_run(bench, kind):
    """The emulated index is a quarter of a turn from zero, and once in each turn."""
    axis, connect = bench(kind)
    for home in (0.25, 1.25):
        actuator = connect(homing={"method": 34})
        actuator.connect()
        actuator.reference()
        assert turns(axis) == pytest.approx(home, abs=0.02)
        actuator.make_safe()
        actuator.close()


@pytest.mark.parametrize("kind", ["cia402", "nanotec", *MAKES])
def test_samples_are_taken_where_the_motor_has_arrived(bench, kind):
    axis, connect = bench(kind)
    slow = {"velocity": "2 Hz", "acceleration_time": "20 ms"}
    actuator = connect(profile=slow, settle="20 ms")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    first = None
    for samples in actuator.play(Acquisition(1, Motion(1, 8, 1.0, 1))):
        first = turns(axis) - samples.phase[-1] / TURN if first is None else first
        assert turns(axis) - samples.phase[-1] / TURN == pytest.approx(first, abs=0.006)
    actuator.make_safe()
    actuator.close()


@pytest.mark.parametrize("kind", MAKES)
def test_moves_of_no_length_arrive(bench, kind):
    _, connect = bench(kind)
    actuator = connect()
    actuator.connect()
    for angle in (0.0, 1.0, 1.0, 1.0 + TURN / COUNTS):
        actuator.turn_to(angle)
    actuator.make_safe()


@pytest.mark.parametrize("kind", MAKES)
def test_power_that_is_lost_in_mid_motion_is_told_and_not_given_back(bench, kind):
    axis, connect = bench(kind)
    actuator = connect(profile={"velocity": "1 Hz"})
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    chunks = actuator.play(Acquisition(1, Motion(4, 8, 1.0, 1)))
    next(chunks)
    with axis.lock:
        axis.set_controlword(0x00)
    with pytest.raises(DeviceError, match="in mid-motion, without an alarm"):
        list(chunks)
    actuator.make_safe()
    assert axis.state == DISABLED


@pytest.mark.parametrize("kind", MAKES)
def test_power_that_is_lost_in_homing_is_told(bench, kind):
    axis, connect = bench(kind)
    actuator = connect(homing={"method": 34})
    actuator.connect()
    axis.profile_velocity //= 100
    cut = Timer(0.3, axis.set_controlword, [0x00])
    cut.start()
    with pytest.raises(DeviceError, match="in mid-motion, without an alarm"):
        actuator.reference()
    cut.join()


@pytest.mark.parametrize("kind", ["cia402", *MAKES])
def test_making_an_idle_drive_safe_does_not_energize_it(bench, kind):
    axis, connect = bench(kind)
    actuator = connect()
    actuator.connect()
    actuator.make_safe()
    time.sleep(0.05)
    actuator.close()
    assert axis.state == DISABLED


@pytest.mark.parametrize("kind", MAKES)
def test_an_alarm_of_an_earlier_time_is_reset_by_a_drive_that_shows_it_late(bench, kind, caplog):
    axis, connect = bench(kind)
    with axis.lock:
        axis.fail(0x20)
    time.sleep(0.05)
    actuator = connect()
    actuator.connect()
    assert "acknowledged the fault 0x0020 of an earlier time" in caplog.text
    actuator.turn_to(1.0)
    assert axis.state == ENABLED
    actuator.make_safe()


def test_what_a_pause_left_of_a_move_is_not_resumed(bench):
    """An IAI controller takes up a paused move again when the pause ends (manual, 5.4.6)."""
    axis, connect = bench("iai")
    actuator = connect(profile={"velocity": "1 Hz"})
    actuator.connect()
    moving = actuator._player.stepper.moving_to(20 * TURN)
    next(moving)
    moving.close()
    time.sleep(0.1)
    stopped = turns(axis)
    actuator._drive._energize()
    time.sleep(0.3)
    assert axis.state == ENABLED
    assert turns(axis) == pytest.approx(stopped, abs=1e-3)
    actuator.make_safe()


SHORT = {
    "cia402": "a limit of its own is active",
    "leadshine": r"arrived at 1\.5000 revolutions from home, but stands at 1\.0\d+, 0\.[45]\d+",
}


@pytest.mark.parametrize("kind", SHORT)
def test_a_drive_that_stands_elsewhere_than_it_says_is_found_out(bench, kind):
    """It has limits of its own, below what it was sent to."""
    axis, connect = bench(kind)
    with axis.lock:
        axis.limits = (0, COUNTS)
    actuator = connect()
    actuator.connect()
    with pytest.raises(DeviceError) as told:
        actuator.turn_to(1.5 * TURN)
    assert re.search(SHORT[kind], str(told.value))
    actuator.make_safe()


def test_a_lead_of_no_whole_hundredths_adds_up_to_no_error(bench):
    """1.5875 mm, a sixteenth of an inch, is 158.75 counts of an IAI controller."""
    axis, connect = bench("iai", {"lead": "1.5875 mm"}, speed=4)
    actuator = connect(lead="1.5875 mm")
    actuator.connect()
    for revolution in (1, 7, 40):
        actuator.turn_to(revolution * TURN)
        time.sleep(0.05)
        assert turns(axis) == pytest.approx(revolution, abs=0.6 / 158.75)
    actuator.make_safe()
