"""`modbus`: a run that is stopped while a device is silent, and a plug that is pulled."""

import os
import pty
import signal
import socket
import sys
import tty
from contextlib import contextmanager

import pytest

from labdrive.interfaces.devices import Acquisition
from labdrive.model.errors import DeviceError, RunInterruptedError
from labdrive.model.motion import Motion
from labdrive_spindle.modbus_bus import ModbusBus

from .conftest import context
from .test_modbus import actuator_on, drive, link  # noqa: F401 fixtures


@pytest.fixture
def silent(request, link):  # noqa: F811
    """Return a function that connects to a device that never answers."""
    ours, theirs = pty.openpty()
    for end in (ours, theirs):
        tty.setraw(end)
    listening = socket.create_server(("127.0.0.1", 0))

    def connect(wire, **settings):
        if wire == "rtu":
            return link({"device": os.ttyname(theirs)}, **settings)
        return link({"host": "127.0.0.1", "port": listening.getsockname()[1]}, **settings)

    yield connect
    listening.close()
    os.close(ours)
    os.close(theirs)


def interruption(*_):
    raise RunInterruptedError("stopped by SIGINT")


@pytest.mark.parametrize("moment", [0.02, 0.11, 0.27])
@pytest.mark.parametrize("wire", ["tcp", "rtu"])
def test_a_signal_ends_the_wait_for_a_silent_device(silent, wire, moment):
    bus = silent(wire, timeout="0.1 s", retries=10)
    before = signal.signal(signal.SIGALRM, interruption)
    signal.setitimer(signal.ITIMER_REAL, moment)
    try:
        with pytest.raises(RunInterruptedError):
            bus.read(1, 3, 0, 1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def interrupted_at(line):
    """Raise what a signal's handler raises, at the n-th line that is run in the block."""
    left = line

    def trace(_frame, event, _argument):
        nonlocal left
        left -= event == "line"
        if left <= 0:
            sys.settrace(None)
            interruption()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield
    finally:
        sys.settrace(before)


def interrupt_everywhere(bus):
    """Interrupt a question at one line after the other, until it runs into its end."""
    for line in range(1, 100_000, 5):
        try:
            with interrupted_at(line):
                bus.read(1, 3, 0, 1)
        except RunInterruptedError:
            continue
        except DeviceError:
            return line
    raise AssertionError


# A socket that was interrupted before it was anybody's is left to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("wire", ["tcp", "rtu"])
def test_an_interruption_gets_out_wherever_it_comes(silent, wire):
    """Each question but the first begins with the wait for a late answer to the one before."""
    bus = silent(wire, timeout="10 ms", retries=0)
    assert interrupt_everywhere(bus) > 50


def test_an_interruption_gets_out_while_a_port_is_opened_again(drive, link, tmp_path):  # noqa: F811
    program = drive("cia402", "--pty")
    port = tmp_path / "ttyUSB0"
    port.symlink_to(program.where["device"])
    bus = link({"device": str(port)}, retries=0)
    program.kill()
    port.unlink()
    assert interrupt_everywhere(bus) > 50


@pytest.mark.parametrize("retries", [0, 2])
def test_an_adapter_that_was_unplugged_is_told_by_whoever_needs_it(drive, link, retries):  # noqa: F811
    program = drive("cia402", "--pty")
    actuator = actuator_on(link(program.where, retries=retries, timeout="0.2 s"), watchdog="0.4 s")
    actuator.connect()
    actuator.load(actuator.nominal_table(None))
    chunks = actuator.play(Acquisition(1, Motion(4, 64, 1.0, 1)))
    next(chunks)
    program.kill()
    with pytest.raises(DeviceError, match="does not answer"):
        list(chunks)
    for _ in range(2):
        with pytest.raises(
            DeviceError, match=r"unit 1 does not answer: .*pts/\d+ cannot be reached"
        ):
            actuator.make_safe()
    actuator.close()


def test_an_adapter_that_was_plugged_in_again_is_opened_again(drive, link, tmp_path):  # noqa: F811
    """Whoever asks next is answered: a quick stop, above all."""
    port = tmp_path / "ttyUSB0"
    first = drive("cia402", "--pty")
    port.symlink_to(first.where["device"])
    bus = link({"device": str(port)}, timeout="0.2 s", retries=0)
    first.kill()
    port.unlink()
    for _ in range(2):
        with pytest.raises(DeviceError, match="does not answer"):
            bus.read(1, 3, 0x1010, 2)
    port.symlink_to(drive("cia402", "--pty").where["device"])
    assert bus.read(1, 3, 0x1010, 2) == [0, 0]


def test_a_closed_link_says_so():
    bus = ModbusBus(ModbusBus.Settings(host="127.0.0.1"), context("bus"))
    with pytest.raises(DeviceError, match="bus: not connected"):
        bus.read(1, 3, 0, 1)
    bus.close()
