"""The state machine of CiA 402: every statusword, every way to operation and back."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labdrive.model.errors import DeviceError
from labdrive_sim.drive_axis import STOPPING, Axis
from labdrive_sim.spindle import Spindle
from labdrive_spindle.cia402 import (
    State,
    StateMachine,
    command_towards_operation,
    state_of,
)
from labdrive_spindle.cia402_drive import Cia402Drive
from labdrive_spindle.fault_words import words_for

from .conftest import context

# Statuswords as drives send them, IEC 61800-7-201: with voltage, remote, target reached.
SEEN = {
    0x0000: State.NOT_READY,
    0x0250: State.SWITCH_ON_DISABLED,
    0x0231: State.READY,
    0x0233: State.SWITCHED_ON,
    0x1637: State.OPERATION_ENABLED,
    0x0217: State.QUICK_STOP,
    0x021F: State.FAULT_REACTION,
    0x0218: State.FAULT,
}


@pytest.mark.parametrize(("word", "state"), SEEN.items())
def test_states_are_read_from_statuswords(word, state):
    assert state_of(word) is state


@given(st.integers(0, 0xFF90))
def test_bits_that_mean_something_else_do_not_change_the_state(noise):
    for word, state in SEEN.items():
        assert state_of(word ^ noise & 0xFF90) is state


class Emulated:
    """A drive's objects, without a bus."""

    def __init__(self):
        plant = Spindle(Spindle.Settings.model_validate({}), context("plant"))
        plant.connect()
        self.axis = Axis(plant)
        self.refused = frozenset()

    def read(self, name):
        self.axis.advance(0.01)
        return {
            "statusword": self.axis.statusword,
            "error_code": self.axis.error_code,
            "mode_display": self.axis.mode,
            "position": self.axis.actual,
        }[name]

    def write(self, name, value):
        if name in self.refused:
            return
        if name == "controlword":
            self.axis.set_controlword(value)
        elif name == "mode":
            self.axis.set_mode(value)
        elif name == "target_position":
            self.axis.target = value
        elif name == "homing_method":
            self.axis.homing_method = value

    def has(self, name):
        return name == "homing_method"


def test_a_word_that_is_no_state_is_refused():
    # Of the bits that tell the state, only "switched on" and "quick stop".
    with pytest.raises(DeviceError, match="statusword 0x0022 is none that CiA 402 knows"):
        state_of(0x0022)


@settings(deadline=None)
@given(words=st.lists(st.sampled_from([0x00, 0x02, 0x06, 0x07, 0x0F, 0x80, 0x1F]), max_size=8))
def test_operation_is_reached_from_wherever_commands_have_led(words):
    drive = Emulated()
    for word in words:
        drive.axis.set_controlword(word)
    machine = StateMachine(drive, "spindle")
    machine.enable()
    machine.enable()
    assert machine.state is State.OPERATION_ENABLED
    assert command_towards_operation(machine.state) is None
    machine.quick_stop()
    machine.quick_stop()
    assert machine.state is State.QUICK_STOP


def test_a_drive_that_does_not_say_its_state_is_stopped_all_the_same():
    drive = Emulated()
    machine = StateMachine(drive, "spindle")
    machine.enable()
    answers = iter([DeviceError("damaged")])

    def read(name, kept=drive.read):
        for error in answers:
            raise error
        return kept(name)

    drive.read = read
    machine.quick_stop()
    assert drive.axis.state == STOPPING


def test_a_motor_stays_energized_from_quick_stop_to_operation():
    drive = Emulated()
    machine = StateMachine(drive, "spindle")
    machine.enable()
    machine.quick_stop()
    seen = []
    drive.axis.set_controlword, kept = (
        lambda word: (seen.append(word), kept(word)),
        drive.axis.set_controlword,
    )
    machine.enable()
    assert seen == [0x0F]


def test_a_drive_that_cannot_go_on_from_quick_stop_is_switched_on_anew():
    drive = Emulated()
    machine = StateMachine(drive, "spindle")
    machine.enable()
    machine.quick_stop()
    stubborn, kept = drive.axis.set_controlword, drive.axis

    def without_transition_16(word):
        if not (kept.state == STOPPING and word == 0x0F):
            stubborn(word)

    drive.axis.set_controlword = without_transition_16
    machine.enable()
    assert machine.state is State.OPERATION_ENABLED


def test_a_fault_is_told_in_words_and_reset_only_when_asked():
    drive = Emulated()
    machine = StateMachine(drive, "spindle", timeout_s=0.1)
    machine.enable()
    drive.axis.fail(0x8611)
    with pytest.raises(DeviceError, match=r"too large a following error \(code 0x8611\)"):
        machine.enable()
    assert machine.state is State.FAULT
    assert machine.reset_fault() == 0x8611
    assert machine.reset_fault() == 0
    machine.enable()


def test_a_fault_that_stays_and_a_drive_that_ignores_are_told():
    drive = Emulated()
    machine = StateMachine(drive, "spindle", timeout_s=0.05)
    drive.refused = {"controlword"}
    with pytest.raises(DeviceError, match="'switch on disabled' and does not enable"):
        machine.enable()
    drive.axis.fail(0x3210)
    with pytest.raises(DeviceError, match=r"over-voltage.* cannot be reset"):
        machine.reset_fault()
    drive.axis.state = 4  # operation enabled
    with pytest.raises(DeviceError, match="ignores the quick stop; cut its power"):
        machine.quick_stop()


def test_a_mode_that_the_drive_refuses_is_found_out():
    drive = Emulated()
    moved = Cia402Drive(drive, "spindle", 1 << 20)
    drive.refused = {"mode"}
    with pytest.raises(DeviceError, match=r"refuses the mode profile position \(1\): it shows 0"):
        moved.start(0)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (0x7305, "incremental encoder"),
        (0x2311, "current"),
        (0xFF42, "manufacturer"),
        (0x0123, "unknown"),
    ],
)
def test_codes_that_are_not_listed_are_told_by_their_group(code, said):
    assert said in words_for(code)
    assert f"0x{code:04X}" in words_for(code)
