"""The state machine of CiA 402 drives (IEC 61800-7-201), the same over CANopen and Modbus."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Protocol

from labdrive.model.errors import DeviceError
from labdrive_spindle.fault_words import words_for

POLL_S = 0.005


class State(StrEnum):
    """State of the power drive system."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


class Mode(IntEnum):
    """Modes of operation (object 6060h) that labdrive uses."""

    PROFILE_POSITION = 1
    HOMING = 6
    CYCLIC_POSITION = 8


# (mask, value) of the statusword, IEC 61800-7-201, statusword.
_STATES = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP),
    (0x4F, 0x0F, State.FAULT_REACTION),
    (0x4F, 0x08, State.FAULT),
)

SHUTDOWN = 0x06
SWITCH_ON = 0x07
DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
ENABLE_OPERATION = 0x0F
FAULT_RESET = 0x80
# With operation enabled: take a new set-point, or begin homing.
START = 0x10
AT_ONCE = 0x20

TARGET_REACHED = 1 << 10
INTERNAL_LIMIT = 1 << 11
# Bits 12 and 13 mean another thing in each mode.
SET_POINT_TAKEN = HOMED = FOLLOWS = 1 << 12
FOLLOWING_ERROR = HOMING_ERROR = 1 << 13

FAULTS = frozenset({State.FAULT, State.FAULT_REACTION})

# The command that leads one state nearer to operation.
_TOWARDS_OPERATION = {
    State.SWITCH_ON_DISABLED: SHUTDOWN,
    State.READY: SWITCH_ON,
    State.SWITCHED_ON: ENABLE_OPERATION,
    # Transition 16: the motor stays energized, so that nothing sags.
    State.QUICK_STOP: ENABLE_OPERATION,
}


def state_of(statusword: int) -> State:
    """Return the state that a statusword tells; DeviceError if it tells none."""
    for mask, value, state in _STATES:
        if statusword & mask == value:
            return state
    raise DeviceError(f"statusword 0x{statusword:04X} is none that CiA 402 knows")


def command_towards_operation(state: State) -> int | None:
    """Return the controlword that leads nearer to operation; None to wait, or if it is there."""
    return _TOWARDS_OPERATION.get(state)


class Objects(Protocol):
    """A drive's objects by name, whatever the bus; see `canopen_objects.DRIVE` for the names."""

    def read(self, name: str) -> int:
        """Return an object; DeviceError if the drive does not give it."""

    def write(self, name: str, value: int) -> None:
        """Write an object; DeviceError if the drive does not take it."""

    def has(self, name: str) -> bool:
        """Whether the drive is known to have it."""

    def refuse_trouble(self) -> None:
        """Raise DeviceError if the drive has restarted or fallen silent, as far as can be told."""


@dataclass(frozen=True)
class StateMachine:
    """Leads one drive through its states. `name` is the device's on the bench."""

    objects: Objects
    name: str
    timeout_s: float = 2.0

    @property
    def state(self) -> State:
        """The state, read from the drive."""
        return state_of(self.objects.read("statusword"))

    def command(self, controlword: int) -> None:
        """Write the controlword."""
        self.objects.write("controlword", controlword)

    def enable(self) -> None:
        """Reach operation; DeviceError, with the fault in words, if the drive refuses.

        Does nothing to a drive that is there. A fault is not reset: see `reset_fault`.
        """
        until = time.monotonic() + self.timeout_s
        tried: State | None = None
        while (state := self.state) is not State.OPERATION_ENABLED:
            self.refuse_fault(state)
            if time.monotonic() > until:
                raise DeviceError(
                    f"{self.name}: the drive stays in the state {state.value!r} and does not "
                    "enable; is its power stage supplied, and is safe torque off closed?"
                )
            command = command_towards_operation(state)
            if state is State.QUICK_STOP and tried is state:
                command = DISABLE_VOLTAGE  # a drive without transition 16
            if command is not None:
                self.command(command)
            tried = state
            self._left(state, 0.1)

    def reset_fault(self) -> int:
        """Acknowledge a fault, if there is one; return its code, 0 if there was none.

        DeviceError if it stays.
        """
        if self.state not in FAULTS:
            return 0
        code = self.objects.read("error_code")
        self.command(DISABLE_VOLTAGE)
        self.command(FAULT_RESET)
        cleared = self._until(lambda state: state not in FAULTS, self.timeout_s)
        self.command(DISABLE_VOLTAGE)
        if not cleared:
            raise DeviceError(
                f"{self.name}: {words_for(code)} cannot be reset; remove its cause first"
            )
        return code

    def quick_stop(self) -> None:
        """Stop on the quick-stop ramp; a drive that does not drive is left alone.

        One that does not say is stopped all the same.
        """
        with suppress(DeviceError):
            if self.state is not State.OPERATION_ENABLED:
                return
        self.command(QUICK_STOP)
        if not self._left(State.OPERATION_ENABLED, self.timeout_s):
            raise DeviceError(f"{self.name}: the drive ignores the quick stop; cut its power")

    def check(self, statusword: int) -> State:
        """Return the state of a statusword; DeviceError, in words, if it is a fault."""
        state = state_of(statusword)
        self.refuse_fault(state)
        return state

    def refuse_idle(self, statusword: int) -> None:
        """Raise DeviceError, in words, if the drive does not drive, or not where it is told to."""
        state = self.check(statusword)
        if state is not State.OPERATION_ENABLED:
            raise DeviceError(
                f"{self.name}: the drive left operation by itself: it is in the state "
                f"{state.value!r}; was safe torque off or its enable opened, or did it restart?"
            )
        if statusword & INTERNAL_LIMIT:
            raise DeviceError(
                f"{self.name}: the drive says that a limit of its own is active (statusword bit "
                "11); look at its position range (607Dh) and its limit switches"
            )

    def refuse_fault(self, state: State) -> None:
        """Raise DeviceError, with the fault in words, if the state is one."""
        if state in FAULTS:
            code = self.objects.read("error_code")
            raise DeviceError(f"{self.name}: the drive stopped itself: {words_for(code)}")

    def _left(self, state: State, seconds: float) -> bool:
        return self._until(lambda now: now is not state, seconds)

    def _until(self, reached: Callable[[State], bool], seconds: float) -> bool:
        until = time.monotonic() + seconds
        while not reached(self.state):
            if time.monotonic() > until:
                return False
            time.sleep(POLL_S)
        return True
