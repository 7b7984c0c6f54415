"""`spindle-modbus` and `modbus-register`: registers, makes of drives, and what goes wrong."""

import os
import pty
import re
import select
import struct
import subprocess
import time
import tty
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labdrive.interfaces.devices import Acquisition
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.motion import Direction, Motion
from labdrive.model.waveform import TURN
from labdrive.testing import check_actuator, check_sensor
from labdrive_spindle.iai import move_block
from labdrive_spindle.leadshine import LeadshineDrive, path_block
from labdrive_spindle.modbus_actuator import ModbusSpindle
from labdrive_spindle.modbus_bus import ModbusBus
from labdrive_spindle.modbus_sensor import ModbusRegister
from labdrive_spindle.register_maps import LEADSHINE
from labdrive_spindle.registers import Register, Unit

from .conftest import context

COUNTS = 100_000
REGISTERS = {
    "controlword": {"address": 0x1000},
    "statusword": {"address": 0x1001},
    "error_code": {"address": 0x1002},
    "mode": {"address": 0x1003},
    "mode_display": {"address": 0x1004},
    "homing_method": {"address": 0x1005},
    "watchdog_time": {"address": 0x1006, "write": 6},
    "position": {"address": 0x1010, "type": "int32"},
    "target_position": {"address": 0x1012, "type": "int32"},
    "profile_velocity": {"address": 0x1014, "type": "uint32"},
    "profile_acceleration": {"address": 0x1016, "type": "uint32"},
}
IN_TENTHS = {"address": 0x1006, "scale": 100}
MOTION = Motion(periods=1, samples_per_period=16, period_rate_hz=1.0, settle_periods=1)


@pytest.fixture
def link():
    """Connect links to where a program or a peer is; closed with the test."""
    made = []

    def connect(where, **settings):
        place = {k: where[k] for k in ("host", "port", "device") if k in where}
        parity = {"parity": "none"} if "device" in where else {}
        given = {"timeout": "0.5 s", "retries": 0, **place, **parity, **settings}
        bus = ModbusBus(ModbusBus.Settings.model_validate(given), context("bus"))
        bus.connect()
        made.append(bus)
        return bus

    yield connect
    for bus in made:
        bus.close()


def actuator_on(bus, kind="cia402", **settings):
    given = {
        "link": "bus",
        "map": kind,
        "counts_per_revolution": COUNTS,
        "profile": {"velocity": "10 Hz", "acceleration_time": "20 ms"},
        "settle": "1 ms",
        **({"registers": REGISTERS} if kind == "cia402" else {}),
        **settings,
    }
    return ModbusSpindle(ModbusSpindle.Settings.model_validate(given), context("spindle", bus=bus))


@pytest.fixture
def drive(drive_program):
    """Start an emulated drive of a make, over TCP or on a terminal, its clock eight times fast."""

    def start(kind="cia402", *options):
        fast = ("--speed", "8", "--counts", str(COUNTS), "--map", kind)
        return drive_program("modbus", *fast, *options)

    return start


@pytest.mark.parametrize("wire", ["tcp", "rtu"])
@pytest.mark.parametrize("kind", ["cia402", "nanotec", "leadshine", "iai"])
def test_every_make_conforms_over_tcp_and_on_a_serial_line(drive, link, kind, wire):
    program = drive(kind, *(["--pty"] if wire == "rtu" else []))
    bus = link(program.where, timeout="2 s")
    homing = {} if kind == "nanotec" else {"homing": {"method": 34 if kind == "iai" else 35}}
    actuator = actuator_on(bus, kind, **homing)
    check_actuator(actuator, None, MOTION)
    sensor = ModbusRegister(
        ModbusRegister.Settings.model_validate(
            {"link": "bus", "value": {"address": 0x7000, "type": "int32"}, "one": "1 nm"}
        ),
        context("encoder", bus=bus),
    )
    assert sensor.unit == "m"
    check_sensor(sensor, actuator_on(bus, kind, **homing), None, MOTION)


@pytest.mark.parametrize("direction", Direction)
def test_phases_are_those_of_whole_counts(drive, link, direction):
    """An IAI axis moves by 0.01 mm: a hundredth of a turn of a screw of 1 mm lead."""
    actuator = actuator_on(link(drive("iai").where), "iai", homing={"method": 34})
    actuator.connect()
    actuator.reference()
    actuator.load(actuator.nominal_table(None))
    motion = Motion(1, 16, 1.0, 1, direction)
    chunks = list(actuator.play(Acquisition(1, motion)))
    phase = np.concatenate([c.phase for c in chunks if not c.settling])
    hundredths = 100 * phase / TURN
    assert hundredths == pytest.approx(np.round(hundredths), abs=1e-6)
    assert phase == pytest.approx(direction.sign * TURN * np.arange(17) / 16, abs=TURN / 199)
    actuator.make_safe()
    actuator.close()


KINDS = {"int16": 16, "uint16": 16, "int32": 32, "uint32": 32}


@given(
    data=st.data(), kind=st.sampled_from(sorted(KINDS)), words=st.sampled_from(["big", "little"])
)
def test_registers_hold_what_was_put_into_them(data, kind, words):
    bits = KINDS[kind]
    low = -(1 << bits - 1) if kind.startswith("int") else 0
    value = data.draw(st.integers(low, low + (1 << bits) - 1))
    register = Register(address=0, type=kind, words=words)
    held = register.encode(value)
    assert register.decode(held) == value
    raw = b"".join(word.to_bytes(2, "big") for word in (held if words == "big" else held[::-1]))
    assert int.from_bytes(raw, "big", signed=kind.startswith("int")) == value


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_floats_are_held_too(value):
    register = Register(address=0, type="float32")
    assert struct.pack(">HH", *register.encode(value)) == struct.pack(">f", value)
    assert register.decode(register.encode(value)) == value


def test_a_value_beyond_its_register_is_refused():
    with pytest.raises(DeviceError, match=r"65536 does not fit register 0x0010 of type uint16"):
        Register(address=0x10).encode(65536)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"address": 5, "type": "int32", "write": 6}, "writes a single register"),
        ({"address": 0xFFFF, "type": "int32"}, "beyond 0xFFFF"),
    ],
)
def test_a_register_that_cannot_be_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        Register.model_validate(settings)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"registers": {**REGISTERS, "statsword": {"address": 1}}}, "statusword"),
        ({"registers": {"controlword": {"address": 1}}}, "missing: statusword, error_code"),
        ({"counts_per_revolution": None}, "counts_per_revolution: missing"),
        ({"map": "iai"}, "has registers of its own"),
        ({"map": "iai", "registers": {}, "watchdog": "1 s"}, "needs a register watchdog_time"),
        ({"watchdog": "70 s"}, "spindle.watchdog: in ms, 70000 does not fit register 0x1006"),
        (
            {"watchdog": "4 ms", "registers": {**REGISTERS, "watchdog_time": IN_TENTHS}},
            "spindle.watchdog: would be 0 in its register",
        ),
    ],
)
def test_a_map_that_does_not_fit_is_refused(changed, said):
    bus = ModbusBus(ModbusBus.Settings(host="127.0.0.1"), context("bus"))
    with pytest.raises(InputError, match=said):
        actuator_on(bus, **changed)


# From the CS2RS manual, 4.5; it says 200 rpm beside it, but the frame has 0 there.
SENT = bytes.fromhex(
    "07 10 62 00 00 08 10 00 01 00 00 27 10 00 00 27 10 27 10 00 00 00 10 8D 50".replace(" ", "")
)
ANSWERED = bytes.fromhex("0710620000 08DE11".replace(" ", ""))


def test_leadshines_own_frames_go_over_the_line(link):
    """What the manual prints is what is sent, byte for byte, and its answer is taken."""
    ours, theirs = pty.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    received = bytearray()

    def answer():
        while len(received) < len(SENT) and select.select([ours], [], [], 5)[0]:
            received.extend(os.read(ours, 256))
        os.write(ours, ANSWERED)

    thread = Thread(target=answer)
    thread.start()
    bus = link({"device": os.ttyname(theirs)}, timeout="5 s")
    drive = LeadshineDrive(
        Unit(bus, 7, LEADSHINE), "spindle", 10_000, rpm=0, ramp_ms=10_000, energized=True
    )
    drive.start(10_000)
    thread.join()
    bus.close()
    os.close(ours)
    os.close(theirs)
    assert bytes(received) == SENT


def test_blocks_of_registers_carry_negative_positions_whole():
    assert path_block(-1, 60, 100)[1:3] == [0xFFFF, 0xFFFF]
    assert move_block(-250, 10_000, 30) == [0xFFFF, 0xFF06, 0, 1, 0, 10_000, 30, 0, 0]


@pytest.fixture
def ready(drive, link):
    """Return a program and its connected actuator with the nominal table loaded."""

    def make(*options, link_settings=None, **settings):
        program = drive("cia402", *options)
        actuator = actuator_on(link(program.where, **link_settings or {}), **settings)
        actuator.connect()
        actuator.reference()
        actuator.load(actuator.nominal_table(None))
        return program, actuator

    return make


@pytest.mark.parametrize("wire", ["tcp", "rtu"])
def test_a_late_answer_is_never_taken_for_that_to_another_question(drive, link, wire):
    program = drive("cia402", *(["--pty"] if wire == "rtu" else []))
    bus = link(program.where, timeout="0.2 s", retries=0)
    profile = [1, 0x86A0]
    bus.write(1, 0x1014, profile, single=False)
    assert bus.read(1, 3, 0x1014, 2) == profile
    program.say("delay 0.3")
    with pytest.raises(DeviceError, match="does not answer"):
        all(bus.read(1, 3, 0x1010, 2) for _ in range(1000))  # it reads its terminal in its time
    program.say("well")
    for _ in range(3):
        assert bus.read(1, 3, 0x1014, 2) == profile


FAULTS = {
    "fault 0x3210": "stopped itself: over-voltage of the intermediate circuit",
    "silent": "it does not answer; is it switched on",
    "delay 0.9": "does not answer",
    "as-node 9": "unit 9 answers in its place",
}


@pytest.mark.parametrize("wire", ["tcp", "rtu"])
@pytest.mark.parametrize("fault", [*FAULTS, "garble"])
def test_what_goes_wrong_in_mid_motion_stops_it_with_a_message_of_its_own(ready, fault, wire):
    program, actuator = ready(*(["--pty"] if wire == "rtu" else []))
    chunks = actuator.play(Acquisition(1, Motion(4, 64, 1.0, 1)))
    next(chunks)
    program.say(fault)
    with pytest.raises(DeviceError) as told:
        for _ in chunks:
            pass
    assert re.search(FAULTS.get(fault, "its answer is damaged"), str(told.value)), told.value
    program.say("well")
    time.sleep(1.0)
    actuator.make_safe()
    actuator.close()


def test_a_drive_whose_plug_was_pulled_is_told(ready):
    program, actuator = ready()
    chunks = actuator.play(Acquisition(1, Motion(4, 64, 1.0, 1)))
    next(chunks)
    program.kill()
    with pytest.raises(DeviceError, match="does not answer"):
        list(chunks)


def test_a_damaged_answer_is_asked_for_again(ready):
    """One bad frame on a serial line is not the end of a run of hours."""
    program, actuator = ready("--pty", link_settings={"retries": 2})
    chunks = actuator.play(Acquisition(1, Motion(2, 16, 1.0, 1)))
    next(chunks)
    program.say("garble")
    program.say("well")
    assert len(list(chunks)) == 48
    actuator.make_safe()


def test_exception_answers_are_errors_and_never_data(drive, link):
    bus = link(drive().where)
    with pytest.raises(DeviceError, match=r"illegal data address: .*\(exception 2\)"):
        bus.read(1, 3, 0x4242, 1)
    with pytest.raises(DeviceError, match=r"illegal data address"):
        bus.write(1, 0x1001, [1], single=True)


def test_the_drive_stops_by_itself_when_nobody_speaks_to_it(ready):
    _, actuator = ready(watchdog="0.3 s")
    time.sleep(0.8)
    actuator.reference()  # it was spoken to meanwhile
    actuator._alive.stop()
    time.sleep(0.8)
    with pytest.raises(DeviceError, match="a communication error"):
        actuator.reference()


def test_a_watchdog_of_no_millisecond_is_refused():
    """It would be written as 0, which is off."""
    with pytest.raises(ValueError, match=r"watchdog\n.*greater than or equal to"):
        actuator_on(None, watchdog="0.4 ms")


@pytest.mark.parametrize("delivered", [True, False])
def test_the_watchdog_stays_on_where_the_quick_stop_was_not_delivered(drive, link, delivered):
    """The plug is put in again while labdrive leaves: what the drive does now is its own affair."""
    program = drive("cia402")
    settings = {"timeout": "0.1 s", "retries": 0}
    actuator = actuator_on(link(program.where, **settings), watchdog="0.3 s")
    actuator.connect()
    actuator.turn_to(0.5)
    if not delivered:
        program.say("silent")
        time.sleep(0.2)
        with pytest.raises(DeviceError):
            actuator.make_safe()
        program.say("well")
        time.sleep(0.1)
    else:
        actuator.make_safe()
    actuator.close()
    (left,) = link(program.where).read(1, 3, 0x1006, 1)
    assert left == (0 if delivered else 300)


def test_a_number_of_turns_beyond_the_drives_range_is_refused(ready):
    _, actuator = ready(turns={"min": -1, "max": 2})
    with pytest.raises(DeviceError, match=r"would turn to 3\.000 revolutions"):
        actuator.play(Acquisition(1, Motion(2, 16, 1.0, 1)))
    actuator.make_safe()


def test_nobody_there_is_told_when_connecting():
    settings = ModbusBus.Settings.model_validate({"host": "127.0.0.1", "port": 1, "timeout": "1 s"})
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1:1 cannot be reached"):
        ModbusBus(settings, context("bus")).connect()


@pytest.mark.parametrize("given", [{}, {"host": "h", "device": "/dev/x"}])
def test_a_link_is_either_tcp_or_rtu(given):
    with pytest.raises(ValueError, match="either host"):
        ModbusBus.Settings.model_validate(given)


@pytest.fixture(scope="module")
def peer(tmp_path_factory):
    """Build the server on libmodbus; where that is not installed, unpack Debian's package."""
    folder = tmp_path_factory.mktemp("peer")
    source = Path(__file__).parent / "peer" / "modbus_peer.c"
    built = folder / "modbus_peer"
    include, library = _libmodbus(folder)
    flags = [f"-I{include}", f"-L{library}", f"-Wl,-rpath,{library}"]
    subprocess.run(["cc", source, "-o", built, *flags, "-lmodbus"], check=True)
    return built


def _libmodbus(folder):
    """Return where the header and the library are."""
    if Path("/usr/include/modbus/modbus.h").exists():
        return "/usr/include/modbus", "/usr/lib"
    packages = ["libmodbus5", "libmodbus-dev"]
    try:
        subprocess.run(
            ["apt-get", "download", "-q", *packages], cwd=folder, check=True, capture_output=True
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("libmodbus is not installed and Debian's packages cannot be downloaded")
    for package in folder.glob("*.deb"):
        subprocess.run(["dpkg", "-x", package, folder], check=True)
    (library,) = (folder / "usr/lib").glob("*/libmodbus.so")
    return folder / "usr/include/modbus", library.parent


def served(peer, *arguments):
    process = subprocess.Popen([peer, *arguments], stdout=subprocess.PIPE, text=True)
    return process, int(process.stdout.readline())


def talk(bus):
    """Write and read both ways, as `Unit` does."""
    signed = Register(address=10, type="int32")
    unit = Unit(bus, 7, {"target": signed, "single": Register(address=20, write=6)})
    for value in (0, -1, 123456789, -(1 << 31)):
        unit.write("target", value)
        assert unit.read("target") == value
    unit.write("single", 0xBEEF)
    assert unit.read("single") == 0xBEEF
    assert bus.read(7, 4, 0, 10) == list(range(1000, 1010))
    with pytest.raises(DeviceError, match="illegal data address"):
        bus.read(7, 3, 99, 2)


def test_an_independent_server_is_understood_over_tcp(peer, link):
    process, port = served(peer, "tcp")
    try:
        talk(link({"host": "127.0.0.1", "port": port}))
    finally:
        process.kill()
        process.communicate()


def test_an_independent_server_is_understood_on_a_serial_line(peer, link):
    """Two pseudo-terminals, their outer ends tied together."""
    pairs = [pty.openpty() for _ in range(2)]
    for pair in pairs:
        for end in pair:
            tty.setraw(end)
    outer, inner = zip(*pairs, strict=True)
    ended = False

    def tie():
        while not ended:
            for one in select.select(outer, [], [], 0.05)[0]:
                os.write(outer[1 - outer.index(one)], os.read(one, 256))

    thread = Thread(target=tie)
    thread.start()
    process, _ = served(peer, "rtu", os.ttyname(inner[0]))
    try:
        talk(link({"device": os.ttyname(inner[1])}, timeout="1 s"))
    finally:
        ended = True
        thread.join()
        process.kill()
        process.communicate()
        for end in (*outer, *inner):
            os.close(end)
