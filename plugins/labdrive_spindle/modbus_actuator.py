"""The actuator `spindle-modbus`: a drive with Modbus registers, moved step by step."""

import logging
from collections.abc import Generator
from contextlib import suppress
from threading import Event, Thread
from typing import Literal

from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.quantities import Time
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.units import format_si
from labdrive.model.waveform import WaveformTable
from labdrive_spindle.cia402_drive import Cia402Drive
from labdrive_spindle.iai import IaiDrive
from labdrive_spindle.leadshine import LeadshineDrive
from labdrive_spindle.links import bus_of
from labdrive_spindle.modbus_bus import ModbusBus
from labdrive_spindle.nanotec import read_map
from labdrive_spindle.player import Player
from labdrive_spindle.register_maps import IAI, LEADSHINE, checked
from labdrive_spindle.registers import Register, Unit
from labdrive_spindle.spindle import (
    SpindleSettings,
    nominal_table,
    refuse_fast_profile,
)
from labdrive_spindle.stepping import Drive

log = logging.getLogger(__name__)

MAPS_THAT_NEED_COUNTS = frozenset({"cia402", "nanotec", "leadshine"})


class ModbusSpindle:
    """Follows an angle by moving, settling and being read: its bus is too slow to stream."""

    class Settings(SpindleSettings):
        """Settings of the drive."""

        unit: int = Field(default=1, ge=1, le=247, description="Its number on the bus.")
        map: Literal["cia402", "nanotec", "leadshine", "iai"] = Field(
            default="cia402",
            description="What its registers mean. cia402: `registers` say where the objects are. "
            "nanotec: the drive is asked where. leadshine: CS2RS. iai: ROBO Cylinder.",
        )
        registers: dict[str, Register] = Field(
            default_factory=dict, description="For `cia402`: controlword, statusword and so on."
        )
        image_words: Literal["big", "little"] = Field(
            default="big", description="For `nanotec`: which word of 32 bits comes first."
        )
        watchdog: Time | None = Field(
            default=None,
            ge=1e-3,
            description="The drive stops by itself when it is not spoken to for so long; needs a "
            "register `watchdog_time` in ms.",
        )

    sampling = Sampling.POLLED
    position_unit = "m"
    fixed_motion: Motion | None = None

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._name = context.name
        self._bus = bus_of(context, "actuators", settings.link, ModbusBus, "modbus")
        refuse_fast_profile(settings, context)
        _check_map(settings, f"actuators.{context.name}")
        self._drive: Drive | None = None
        self._unit: Unit | None = None
        self._player: Player | None = None
        self._alive = _KeepAlive()
        self._may_move = False

    @property
    def max_samples_per_period(self) -> int:
        """A sensor can be read on each entry of the table."""
        return self._settings.table_length

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the angle that is the phase."""
        return nominal_table(self._settings.table_length, waveform)

    def travel_per_period(self, _table: WaveformTable) -> float:
        """Return the lead [m]."""
        return self._settings.lead

    def check(self, motion: Motion) -> None:
        """Take any motion: its rate is the drive's own, from step to step."""

    def connect(self) -> None:
        """Reach the drive and set it up; nothing moves."""
        self._may_move = False
        settings = self._settings
        self._drive = drive = self._made()
        fault = drive.prepare(settings.profile)
        if fault:
            log.warning("%s: acknowledged the fault 0x%04X of an earlier time", self._name, fault)
        self._player = Player(drive, settings, self._name)
        if settings.watchdog is not None and self._unit is not None:
            self._unit.write("watchdog_time", _milliseconds(settings.watchdog))
            self._alive.start(drive, settings.watchdog / 4)

    def close(self) -> None:
        """Leave the drive, connected or not.

        Its watchdog stays on where it could not be stopped: nobody else would stop it.
        """
        self._alive.stop()
        watched = self._settings.watchdog is not None
        if self._unit is not None and watched and not self._may_move:
            with suppress(DeviceError):
                self._unit.write("watchdog_time", 0)
        self._drive = self._player = self._unit = None

    def reference(self) -> None:
        """Find the home, once; be in no motion."""
        self._connected_player().reference()

    def load(self, table: WaveformTable) -> None:
        """Turn to the nearest start of the table, which is played from now on."""
        self._connected_player().load(table)

    def turn_to(self, angle: float) -> None:
        """Turn to an angle [rad] from home, and be there."""
        self._connected_player().turn_to(angle)

    def play(self, acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Walk the motion."""
        player, motion = self._connected_player(), acquisition.motion
        return player.walk(motion) if motion.periods else player.walk_back(motion)

    def make_safe(self) -> None:
        """Stop, and hold."""
        if self._drive is not None:
            self._may_move = True
            self._drive.stop()
            self._may_move = False

    def _made(self) -> Drive:
        """Return the drive that the map speaks of."""
        settings, counts = self._settings, self._settings.counts_per_revolution or 0
        number = settings.unit
        if settings.map == "iai":
            return IaiDrive(self._of(IAI), self._name, settings.lead)
        if settings.map == "leadshine":
            return LeadshineDrive(self._of(LEADSHINE), self._name, counts)
        own = settings.map == "cia402"
        found = settings.registers if own else read_map(self._bus, number, settings.image_words)
        return Cia402Drive(self._of(found), self._name, counts, settings.velocity_units or counts)

    def _of(self, registers: dict[str, Register]) -> Unit:
        self._unit = Unit(self._bus, self._settings.unit, registers)
        return self._unit

    def _connected_player(self) -> Player:
        if self._player is None:
            raise DeviceError(f"{self._name}: not connected")
        return self._player


class _KeepAlive:
    """Speaks to a drive again and again, so that its watchdog sees that somebody is there."""

    def __init__(self) -> None:
        self._stopped = Event()
        self._thread: Thread | None = None

    def start(self, drive: Drive, period_s: float) -> None:
        """Begin to speak."""
        self._stopped.clear()
        self._thread = Thread(target=self._run, args=(drive, period_s), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Speak no more."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self, drive: Drive, period_s: float) -> None:
        while not self._stopped.wait(period_s):
            with suppress(DeviceError):  # whoever moves the drive next is told
                drive.check()


def _check_map(settings: ModbusSpindle.Settings, field: str) -> None:
    """Raise InputError if the map does not go with the rest of the settings."""
    if settings.map == "cia402":
        checked(settings.registers, f"{field}.registers")
    elif settings.registers:
        message = f"the map {settings.map} has registers of its own; leave this out"
        raise InputError(Problem(message, f"{field}.registers"))
    if settings.map in MAPS_THAT_NEED_COUNTS and settings.counts_per_revolution is None:
        message = "missing: Modbus does not tell the counts in a revolution"
        raise InputError(Problem(message, f"{field}.counts_per_revolution"))
    if settings.watchdog is not None:
        _check_watchdog(settings.watchdog, settings.registers.get("watchdog_time"), field)


def _check_watchdog(watchdog: float, register: Register | None, field: str) -> None:
    """Raise InputError if the time [s] has no register, or is 0 in it, which would be no watch."""
    field = f"{field}.watchdog"
    if register is None:
        message = "needs a register watchdog_time, which this map does not have"
        raise InputError(Problem(message, field))
    try:
        held = register.encode(_milliseconds(watchdog))
    except DeviceError as error:
        raise InputError(Problem(f"in ms, {error}", field)) from error
    if not any(held):
        message = f"would be 0 in its register of scale {register.scale:g}, which is off"
        raise InputError(Problem(message, field, got=format_si(watchdog, "s")))


def _milliseconds(seconds: float) -> int:
    return round(1000 * seconds)
