"""Loads that a motorized stage puts on: it presses a spring against what is to be loaded."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

from pydantic import Field

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Stiffness
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.waveform import TURN
from labdrive_spindle.canopen_actuator import CanopenSpindle
from labdrive_spindle.modbus_actuator import ModbusSpindle


class Spring(SettingsBase):
    """What is between the stage and the load."""

    stiffness: Stiffness = Field(gt=0, description="Of the spring, as 2 N/mm.")
    contact: float = Field(
        default=0.0, description="Revolutions from home at which the spring just touches."
    )


class Stage(Protocol):
    """A spindle that a load turns."""

    def connect(self) -> None:
        """Reach it."""

    def close(self) -> None:
        """Leave it."""

    def reference(self) -> None:
        """Find its home, once."""

    def turn_to(self, angle: float) -> None:
        """Turn to an angle [rad] from home, and be there."""

    def make_safe(self) -> None:
        """Stop, and hold."""


class _StageLoad:
    """Turns forces into angles: force = stiffness times travel since contact."""

    needs_person = False

    def __init__(self, stage: Stage, spring: Spring, lead: float) -> None:
        self._stage, self._spring, self._lead = stage, spring, lead
        self._homed = False

    def connect(self) -> None:
        """Reach the stage; nothing moves yet."""
        self._stage.connect()

    def close(self) -> None:
        """Leave the stage, connected or not."""
        self._homed = False
        self._stage.close()

    def apply(self, force: float) -> float:
        """Press the spring with `force` [N], once the home is found; a spring cannot pull."""
        if force < 0:
            raise DeviceError(f"a spring cannot pull: a load of {force:g} N cannot be had")
        if not self._homed:
            self._stage.reference()
            self._homed = True
        self._press(force)
        return force

    def make_safe(self) -> None:
        """Let the spring go, if it is known where that is; stop the stage in any case."""
        try:
            if self._homed:
                self._press(0.0)
        except DeviceError:
            pass
        finally:
            self._stage.make_safe()

    def _press(self, force: float) -> None:
        travel = force / self._spring.stiffness
        self._stage.turn_to(TURN * (self._spring.contact + travel / self._lead))


class CanopenStageLoad(_StageLoad):
    """A stage behind a CANopen drive."""

    class Settings(Spring):
        """The spring, and the drive's settings as those of `spindle-canopen`."""

        drive: CanopenSpindle.Settings

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        with _placed():
            stage = CanopenSpindle(settings.drive, context)
        super().__init__(stage, settings, settings.drive.lead)


class ModbusStageLoad(_StageLoad):
    """A stage behind a Modbus drive."""

    class Settings(Spring):
        """The spring, and the drive's settings as those of `spindle-modbus`."""

        drive: ModbusSpindle.Settings

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        with _placed():
            stage = ModbusSpindle(settings.drive, context)
        super().__init__(stage, settings, settings.drive.lead)


@contextmanager
def _placed() -> Iterator[None]:
    """Tell what is wrong with the drive's settings where they stand: in the bench's load."""
    try:
        yield
    except InputError as error:
        moved = [
            replace(p, field=p.field.replace("actuators.load", "load.drive", 1))
            for p in error.problems
        ]
        raise InputError(*moved) from error
