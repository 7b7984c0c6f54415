"""`spindle-canopen` and `canopen-encoder` on a bus: configuration, motion, and what goes wrong."""

import re
import time
from dataclasses import replace

import can
import numpy as np
import pytest

from labdrive.interfaces.devices import Acquisition
from labdrive.interfaces.limits import Limits
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.motion import Direction, Motion
from labdrive.model.waveform import TURN
from labdrive.testing import check_actuator, check_sensor
from labdrive_sim.canopen_node import flood
from labdrive_sim.drive_axis import DISABLED, ENABLED, FAULT, STOPPING
from labdrive_spindle.canopen_actuator import CanopenSpindle

from .conftest import context

LEAD = 1e-3
# 500 SYNCs a second.
MOTION = Motion(periods=3, samples_per_period=50, period_rate_hz=10.0, settle_periods=2)
PLAIN = {"screw_error": [], "detent": [], "backlash": "0 um", "friction": "0 N*m"}


@pytest.fixture
def ready(can_bench):
    """Return a bench and its connected actuator with the nominal table loaded."""

    def make(plant=None, **settings):
        bench = can_bench(plant)
        actuator = bench.actuator(**settings)
        actuator.connect()
        actuator.reference()
        actuator.load(actuator.nominal_table(None))
        return bench, actuator

    return make


def walked(actuator, sensor, motion=MOTION):
    """Return phase, time and reading of the recorded samples."""
    sensor.arm(Acquisition(1, motion))
    chunks = []
    for samples in actuator.play(Acquisition(1, motion)):
        reading = sensor.read(samples)
        if not samples.settling:
            chunks.append((samples.phase, samples.time, reading.value))
    return [np.concatenate(parts) for parts in zip(*chunks, strict=True)]


@pytest.mark.parametrize("mode", ["cyclic", "profile"])
def test_actuator_and_encoder_conform(can_bench, mode):
    bench = can_bench()
    motion = MOTION if mode == "cyclic" else Motion(1, 16, 10.0, 1)
    actuator = bench.actuator(mode=mode, settle="1 ms")
    check_actuator(actuator, None, motion)
    check_sensor(bench.encoder(), bench.actuator(mode=mode, settle="1 ms"), None, motion)


@pytest.mark.parametrize("quantity", ["position", "following_error"])
def test_what_the_drive_knows_of_itself_is_a_sensor(can_bench, quantity):
    bench = can_bench(PLAIN)
    sensor = bench.drive_sensor(quantity=quantity)
    check_sensor(sensor, bench.actuator(), None, MOTION)
    actuator = bench.actuator()
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    start = bench.axis.actual
    phase, _, angle = walked(actuator, sensor)
    if quantity == "position":
        turned = TURN * round(start / bench.axis.settings.counts_per_turn)
        assert angle - turned == pytest.approx(phase + 2 * TURN, abs=1e-3)
    else:
        # A control that is 2 ms late, at 10 revolutions a second.
        assert angle == pytest.approx(TURN * 10 * 2e-3, rel=0.1)


@pytest.mark.parametrize("direction", Direction)
def test_the_phase_is_what_the_motor_has_reached(ready, direction):
    """Interpolation takes a cycle, the motor's control 2 ms: neither is in the phase."""
    bench, actuator = ready(PLAIN)
    encoder = bench.encoder()
    encoder.connect()
    start = bench.axis.plant.stretch.position[-1]
    motion = Motion(3, 50, 10.0, 2, direction)
    phase, when, position = walked(actuator, encoder, motion)
    settled = start + direction.sign * LEAD * 2
    assert position == pytest.approx(settled + LEAD * phase / TURN, abs=20e-9)
    # 2 ms a cycle of the SYNC, on the whole; this machine may be late now and then.
    assert np.median(np.diff(when)) == pytest.approx(2e-3, rel=0.1)


def test_a_perfect_screw_shows_no_error_and_a_bad_one_its_own(ready):
    error = [{"order": 2, "amplitude": "3 um", "phase": "0 deg"}]
    bench, actuator = ready(PLAIN | {"screw_error": error})
    encoder = bench.encoder()
    encoder.connect()
    phase, _, position = walked(actuator, encoder)
    cycle = (position - LEAD * phase / TURN)[:-1].reshape(3, -1).mean(axis=0)
    second = 2 * np.fft.rfft(cycle)[2] / len(cycle)
    assert abs(second) == pytest.approx(3e-6, rel=1e-3)


def test_a_bus_that_echoes_our_own_frames_changes_nothing(can_bench):
    bench = can_bench(PLAIN, options={"receive_own_messages": True})
    actuator, encoder = bench.actuator(), bench.encoder()
    actuator.connect()
    encoder.connect()
    actuator.load(actuator.nominal_table(None))
    for turns in (0, 5):  # the second motion goes on where the first one ended
        phase, _, position = walked(actuator, encoder)
        assert position == pytest.approx(LEAD * (turns + 2 + phase / TURN), abs=0.1e-6)


def test_the_mapping_is_written_and_read_back(ready):
    bench, _ = ready()
    node = bench.drive.node
    assert node.value(0x1A00, 0) == 2
    assert node.value(0x1A00, 1) == 0x60410010
    assert node.value(0x1A00, 2) == 0x60640020
    assert node.value(0x1600, 2) == 0x607A0020
    assert (node.value(0x60C2, 1), node.value(0x60C2, 2)) == (2, 256 - 3)


def test_a_fixed_mapping_is_found_out(can_bench, monkeypatch):
    bench = can_bench()
    kept = bench.drive.node._node.get_data
    stubborn = {(0x1A00, 2): bytes.fromhex("20006360")}
    monkeypatch.setattr(
        bench.drive.node._node,
        "get_data",
        lambda index, sub, *a, **k: stubborn.get((index, sub)) or kept(index, sub, *a, **k),
    )
    with pytest.raises(DeviceError, match=r"1A00h:2 is 0x60630020, not 0x60640020"):
        bench.actuator().connect()


def test_limits_are_told_to_the_drive_and_held_before_moving(ready):
    bench, actuator = ready(turns={"min": -1, "max": 4}, following_error="20 deg")
    assert bench.axis.limits == (-(1 << 20), 4 << 20)
    assert bench.axis.following_window == pytest.approx((1 << 20) / 18, abs=1)
    before = bench.axis.actual
    with pytest.raises(DeviceError, match=r"would turn to 5\.000 revolutions from home"):
        actuator.play(Acquisition(1, MOTION))
    # Two turns in all, and one and a half to get up to speed.
    with pytest.raises(DeviceError, match=r"would turn to -1\.562 revolutions"):
        list(actuator.play(Acquisition(1, Motion(1, 16, 31.25, 1))))
    assert bench.axis.actual == before


def test_homing_seeks_the_index_once(can_bench):
    bench = can_bench()
    actuator = bench.actuator(homing={"method": 34, "velocity": "5 Hz"})
    actuator.connect()
    actuator.reference()
    time.sleep(0.05)  # the motor comes to rest
    assert abs(bench.axis.actual) < 700  # detent: a few mrad about the index
    turned = bench.axis.plant.motor_angle / TURN
    assert turned == pytest.approx(0.25, abs=0.002)
    actuator.load(actuator.nominal_table(None))
    actuator.reference()
    assert bench.axis.plant.motor_angle / TURN == pytest.approx(turned, abs=0.002)


def test_a_homing_method_that_the_drive_lacks_is_told(can_bench):
    actuator = can_bench().actuator(homing={"method": 17})
    actuator.connect()
    with pytest.raises(DeviceError, match="homing failed"):
        actuator.reference()


def test_a_return_goes_back_in_one_move_to_where_the_motion_began(ready):
    bench, actuator = ready()
    start = bench.axis.actual
    list(actuator.play(Acquisition(1, MOTION)))
    assert bench.axis.actual - start > 4 << 20
    back = list(actuator.play(Acquisition(1, MOTION.returning())))
    assert all(samples.settling for samples in back)
    assert bench.axis.actual == pytest.approx(start, abs=10_000)  # a hundredth of a turn


def test_stopping_in_mid_motion_slows_down_and_holds(ready):
    bench, actuator = ready()
    chunks = actuator.play(Acquisition(1, MOTION))
    next(chunks)
    chunks.close()
    here = bench.axis.demand
    time.sleep(0.05)
    assert bench.axis.demand == here
    assert bench.axis.state == ENABLED
    actuator.make_safe()
    assert bench.axis.state == STOPPING


@pytest.mark.parametrize(
    ("rate", "samples", "said"),
    [(9.0, 50, "10 Hz or 5 Hz|10 Hz"), (10.0, 64, "7.8125 Hz"), (20.0, 50, "10 Hz")],
)
def test_samples_off_the_grid_of_the_sync_are_refused_with_a_rate_that_fits(
    can_bench, rate, samples, said
):
    actuator = can_bench(connect=False).actuator()
    with pytest.raises(InputError, match=said):
        actuator.check(Motion(3, samples, rate, 2))


def test_a_motion_that_does_not_settle_is_refused(can_bench):
    with pytest.raises(InputError, match="settle_periods: must be 1 or more"):
        can_bench(connect=False).actuator().check(Motion(3, 50, 10.0, 0))


def test_a_node_of_another_profile_or_none_at_all_is_told(can_bench):
    bench = can_bench(patience="50 ms")
    with pytest.raises(DeviceError, match="node 6 is a device of profile 406, not of 402"):
        bench.actuator(node=6).connect()
    with pytest.raises(DeviceError, match="node 9 does not answer"):
        bench.actuator(node=9).connect()


def test_a_bench_and_a_drive_that_disagree_on_counts_are_told(can_bench):
    with pytest.raises(DeviceError, match=r"bench says 4096 .* the drive 1048576"):
        can_bench().actuator(counts_per_revolution=4096).connect()


def test_a_profile_faster_than_the_bench_allows_is_refused(can_bench):
    bench = can_bench(connect=False)
    limits = Limits.model_validate({"period_rate": "5 Hz"})
    settings = CanopenSpindle.Settings.model_validate(
        {"link": "can", "node": 5, "profile": {"velocity": "6 Hz"}}
    )
    with pytest.raises(InputError, match=r"profile\.velocity: is above"):
        CanopenSpindle(settings, replace(context("spindle", can=bench.bus), limits=limits))


def test_a_link_that_is_no_can_bus_is_refused(can_bench):
    with pytest.raises(InputError, match="must name a can-bus link; the bench has can"):
        can_bench(connect=False).actuator(link="bus")


def test_an_unknown_interface_is_refused_with_a_suggestion(can_bench):
    with pytest.raises(ValueError, match="socketcan"):
        can_bench(connect=False, interface="socketcn")


def broken(bench, actuator, spoil, motion=MOTION):
    """Spoil something in mid-motion; return what is said, and how long that took [s]."""
    chunks = actuator.play(Acquisition(1, motion))
    next(chunks)
    spoil(bench)
    began = time.monotonic()
    with pytest.raises(DeviceError) as told:
        for _ in chunks:
            pass
    return str(told.value), time.monotonic() - began


FAULTS = {
    "fault": (lambda b: b.axis.fail(0x7305), "stopped itself: an error of the incremental enc"),
    "silent": (lambda b: setattr(b.devices.bus.faults, "silent", True), "nobody was heard"),
    "late": (lambda b: setattr(b.devices.bus.faults, "delay_s", 0.3), "answered the SYNC 3.. ms"),
    "garbled": (lambda b: setattr(b.devices.bus.faults, "garble", True), "3 bytes where 6 are due"),
    "other node": (lambda b: setattr(b.devices.bus.faults, "as_node", 9), "heard instead: node 9"),
    "restart": (lambda b: b.drive.node.restart(), "did not answer|fell back to|left operation"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_goes_wrong_in_mid_motion_stops_it_with_a_message_of_its_own(ready, fault):
    bench, actuator = ready()
    spoil, said = FAULTS[fault]
    message, seconds = broken(bench, actuator, spoil)
    assert seconds < 3
    assert re.search(said, message), message
    bench.devices.bus.faults = type(bench.devices.bus.faults)()
    if fault != "restart":
        actuator.make_safe()
    assert bench.axis.state in {STOPPING, FAULT, DISABLED}


def test_a_flooded_bus_is_told_from_a_silent_one(ready):
    bench, actuator = ready()

    def spoil(bench):
        bench.devices.bus.faults.silent = True
        other = can.Bus(bench.bus.settings.channel, "virtual")
        flood(other, 0.5)
        other.shutdown()

    message, _ = broken(bench, actuator, spoil)
    assert "the bus is flooded" in message
    assert "0x001" in message


def test_a_drive_that_does_not_follow_is_stopped(ready):
    bench, actuator = ready(following_error="10 deg")
    message, _ = broken(bench, actuator, lambda bench: setattr(bench.axis.settings, "lag_s", 0.5))
    assert "does not follow" in message


def test_an_emergency_of_the_encoder_stops_the_motion(ready):
    bench, actuator = ready()
    encoder = bench.encoder()
    encoder.connect()
    chunks = actuator.play(Acquisition(1, MOTION))
    encoder.read(next(chunks))
    bench.devices.encoder.node.emergency(0x7320)
    last = next(chunks)
    with pytest.raises(DeviceError, match=r"node 6 reports an emergency: .*position sensor"):
        encoder.read(last)


def test_the_drive_stops_by_itself_when_this_computer_falls_silent(ready):
    bench, actuator = ready()
    actuator.reference()
    list(actuator.play(Acquisition(1, Motion(1, 50, 10.0, 1))))
    assert bench.axis.state == ENABLED
    bench.bus._closed.set()
    time.sleep(0.8)
    assert bench.axis.state in {STOPPING, FAULT}


def test_leaving_in_order_raises_no_alarm(ready):
    bench, actuator = ready()
    actuator.make_safe()
    actuator.close()
    actuator.close()
    bench.bus._closed.set()
    time.sleep(0.8)
    assert bench.axis.error_code == 0


def test_a_drive_stands_between_motions_for_as_long_as_it_takes(can_bench):
    bench = can_bench()
    actuator = bench.actuator()
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    list(actuator.play(Acquisition(1, MOTION)))
    before = bench.axis.demand
    time.sleep(0.8)  # longer than a drive that follows set-points waits for the SYNC
    assert bench.axis.state == ENABLED
    assert bench.axis.demand == before
    list(actuator.play(Acquisition(2, MOTION)))


def test_units_are_those_the_drive_says(can_bench):
    bench = can_bench()
    bench.drive.node._node.set_data(0x60A9, 0, (0x00B44700).to_bytes(4, "little"))
    actuator = bench.actuator()
    actuator.connect()
    assert bench.drive.node.value(0x6081) == 600  # 10 revolutions a second
    bench.drive.node._node.set_data(0x60A9, 0, (0x00B44800).to_bytes(4, "little"))
    with pytest.raises(DeviceError, match="neither a second nor a minute"):
        bench.actuator().connect()
    bench.actuator(velocity_units=60).connect()


def test_a_drive_still_on_its_way_is_stopped_when_it_is_reached(can_bench):
    bench = can_bench()
    first = bench.actuator()
    first.connect()
    first.load(first.nominal_table(None))
    first._player.stepper.drive.start(100 << 20)
    time.sleep(0.1)
    again = bench.actuator()
    again.connect()
    assert bench.axis.state == STOPPING


def test_a_drive_that_leaves_operation_is_not_switched_on_again(can_bench):
    bench = can_bench()
    actuator = bench.actuator(mode="profile")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    chunks = actuator.play(Acquisition(1, MOTION))
    next(chunks)
    bench.axis.set_controlword(0)  # as when safe torque off opens
    with pytest.raises(DeviceError, match=r"left operation by itself: .* 'switch on disabled'"):
        list(chunks)
    assert bench.axis.state != ENABLED


def test_a_drive_that_restarts_in_profile_mode_is_noticed(can_bench):
    bench = can_bench()
    actuator = bench.actuator(mode="profile")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    chunks = actuator.play(Acquisition(1, MOTION))
    next(chunks)
    bench.drive.node.restart()
    with pytest.raises(DeviceError, match="did it restart"):
        list(chunks)


def test_a_drives_own_limit_is_no_arrival(can_bench):
    bench = can_bench()
    actuator = bench.actuator(mode="profile")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    with bench.axis.lock:
        bench.axis.limits = (-(1 << 20), 1 << 19)
    with pytest.raises(DeviceError, match=r"a limit of its own is active .* \(607Dh\)"):
        list(actuator.play(Acquisition(1, MOTION)))


def test_a_stop_that_did_not_arrive_leaves_the_drives_own_watch(can_bench):
    bench = can_bench()
    actuator = bench.actuator()
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    watched = bench.drive.node.value(0x1016, 1)
    assert watched
    set_controlword, bench.axis.set_controlword = bench.axis.set_controlword, lambda word: None
    with pytest.raises(DeviceError, match="ignores the quick stop"):
        actuator.make_safe()
    actuator.close()
    assert bench.drive.node.value(0x1016, 1) == watched
    bench.axis.set_controlword = set_controlword
    actuator.connect()
    actuator.make_safe()
    actuator.close()
    assert bench.drive.node.value(0x1016, 1) == 0


def test_a_file_that_is_no_eds_is_told(can_bench, tmp_path):
    (tmp_path / "no.eds").write_text("this is none")
    with pytest.raises(DeviceError, match=r"no\.eds is no EDS or DCF"):
        can_bench().actuator(eds=tmp_path / "no.eds").connect()


def test_a_node_is_of_one_device(can_bench):
    bench = can_bench()
    bench.actuator()
    with pytest.raises(InputError, match="is the node of spindle already"):
        bench.encoder(node=5)
    with pytest.raises(InputError, match="this computer's heartbeat"):
        bench.encoder(node=127)


def test_node_guarding_watches_a_drive_without_heartbeat(can_bench):
    bench = can_bench()
    del bench.drive.node._node.object_dictionary[0x1017]
    with pytest.raises(DeviceError, match="refuses to write 100 to 1017h"):
        bench.actuator().connect()
    actuator = bench.actuator(watch="guarding")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    list(actuator.play(Acquisition(1, MOTION)))
    bench.devices.bus.faults.silent = True
    with pytest.raises(DeviceError, match=r"no sign of life|not answer"):
        list(actuator.play(Acquisition(1, MOTION)))


def test_answers_to_guarding_that_do_not_toggle_are_no_sign_of_life(can_bench):
    bench = can_bench()
    actuator = bench.actuator(watch="guarding")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    list(actuator.play(Acquisition(1, MOTION)))
    node = bench.drive.node
    node._network.notifier.remove_listener(node._guard)
    stuck = bytes([5 | 0x80 ^ node._guarded])

    def of_a_controller_whose_processor_is_dead(message):
        if message.is_remote_frame:
            node._on_master()
            node._network.send_message(0x705, stuck)

    node._network.notifier.add_listener(of_a_controller_whose_processor_is_dead)
    time.sleep(0.8)
    with pytest.raises(DeviceError, match=r"node 5 has shown no sign of life for"):
        list(actuator.play(Acquisition(2, MOTION)))


def test_a_guarded_drive_stops_by_itself_when_it_is_asked_no_more(can_bench):
    bench = can_bench()
    actuator = bench.actuator(watch="guarding")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    assert bench.axis.state == ENABLED
    time.sleep(0.8)
    assert bench.axis.state == ENABLED
    actuator._device._remote.nmt.stop_node_guarding()  # as when the process is killed
    time.sleep(0.8)
    assert bench.axis.state in {STOPPING, FAULT}


def test_an_eds_of_another_device_is_refused(can_bench, tmp_path):
    eds = tmp_path / "other.eds"
    eds.write_text(EDS.format(vendor="0x00000042"))
    with pytest.raises(DeviceError, match="is for vendor 0x42, but node 5 has vendor 0xA55A"):
        can_bench().actuator(eds=eds).connect()


def test_values_of_a_dcf_are_written_to_the_drive(can_bench, tmp_path):
    dcf = tmp_path / "drive.dcf"
    dcf.write_text(EDS.format(vendor="0x0000A55A"))
    bench = can_bench()
    bench.actuator(eds=dcf).connect()
    assert bench.drive.node.value(0x6085) == 123456


EDS = """\
[FileInfo]
FileName=drive.eds
[DeviceInfo]
VendorName=labdrive
[DeviceComissioning]
NodeID=5
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018
[OptionalObjects]
SupportedObjects=1
1=0x6085
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0
[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=Entries
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=1
PDOMapping=0
[1018sub1]
ParameterName=Vendor-ID
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue={vendor}
PDOMapping=0
[6085]
ParameterName=Quick stop deceleration
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=1000
ParameterValue=123456
PDOMapping=0
"""
