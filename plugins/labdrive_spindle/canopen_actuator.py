"""The actuator `spindle-canopen`: a CiA 402 drive, streamed to or moved step by step."""

import logging
import math
from collections.abc import Generator
from typing import Literal

from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.quantities import Angle, InputFile, Time
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_device import CanopenDevice
from labdrive_spindle.canopen_follower import CanopenFollower, Pdos, map_pdos
from labdrive_spindle.canopen_objects import DRIVE, DRIVE_PROFILE
from labdrive_spindle.cia402 import StateMachine
from labdrive_spindle.cia402_drive import Cia402Drive
from labdrive_spindle.cia402_units import counts_per_revolution, velocity_units
from labdrive_spindle.links import bus_of, claim_node
from labdrive_spindle.player import Player
from labdrive_spindle.spindle import (
    SpindleSettings,
    nominal_table,
    refuse_fast_profile,
    refuse_turns,
)
from labdrive_spindle.streaming import Grid, Stream, Timing

log = logging.getLogger(__name__)

QUICK_STOP_AND_HOLD = 6
QUICK_STOP_WHEN_ALONE = 3
FOLLOWING_TIMEOUT_MS = 20
GRID_TOLERANCE = 1e-6


class CanopenSpindle:
    """Follows an angle. `cyclic` streams set-points; `profile` moves, settles, and is read."""

    class Settings(SpindleSettings):
        """Settings of the drive."""

        node: int = Field(ge=1, le=127, description="Its node number on the bus.")
        mode: Literal["cyclic", "profile"] = Field(
            default="cyclic",
            description="cyclic: set-points and readings on the SYNC (triggered). profile: move, "
            "settle, read (polled).",
        )
        eds: InputFile | None = Field(
            default=None, description="EDS or DCF of the drive; a DCF's values are written to it."
        )
        following_error: Angle = Field(
            default=0.2, gt=0, description="Largest allowed; also told to the drive (6065h)."
        )
        watch: Literal["heartbeat", "guarding"] = Field(
            default="heartbeat", description="guarding: for drives without heartbeat."
        )
        ramp: Time = Field(
            default=0.1, ge=0, le=10, description="To start, and to stop, whatever for; cyclic."
        )

    position_unit = "m"
    fixed_motion: Motion | None = None

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._name = context.name
        self._bus = bus_of(context, "actuators", settings.link, CanBus, "can-bus")
        claim_node(self._bus, settings.node, "actuators", context.name)
        refuse_fast_profile(settings, context)
        self._device = CanopenDevice(self._bus, settings.node, context.name, DRIVE)
        self._drive: Cia402Drive | None = None
        self._player: Player | None = None
        self.timing = Timing()
        self._pdos: Pdos | None = None

    @property
    def sampling(self) -> Sampling:
        """Triggered by the SYNC, or polled step by step."""
        return Sampling.TRIGGERED if self._settings.mode == "cyclic" else Sampling.POLLED

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
        """Refuse samples that are not a whole number of SYNCs apart, or no time to settle."""
        if self._settings.mode == "cyclic" and motion.periods:
            self._stride(motion)
            if motion.settle_periods < 1:
                message = "must be 1 or more: the lag of the drive is measured while it settles"
                raise InputError(Problem(message, "motion.settle_periods", got="0"))

    def connect(self) -> None:
        """Reach the drive, configure it and read the configuration back; nothing moves."""
        settings, device = self._settings, self._device
        device.connect(DRIVE_PROFILE, None if settings.eds is None else str(settings.eds))
        # It may be on its way yet, sent by a run that died.
        StateMachine(device, self._name).quick_stop()
        counts = self._counts_per_revolution()
        velocity = settings.velocity_units or velocity_units(device.find, counts)
        self._drive = drive = Cia402Drive(device, self._name, counts, velocity)
        code = drive.prepare(settings.profile)
        if code:
            log.warning("%s: acknowledged the fault 0x%04X of an earlier time", self._name, code)
        self._player = Player(drive, settings, self._name)
        self._configure(drive)
        self._pdos = map_pdos(device)
        if settings.watch == "guarding":
            device.start_guarded()
        else:
            device.start(watch_master=True)

    def close(self) -> None:
        """Leave the drive, connected or not."""
        stopped = self._drive is not None and not self._drive.unstopped
        self._device.release(disarm=stopped)
        self._drive = self._player = self._pdos = None

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
        if not motion.periods:
            return player.walk_back(motion)
        self.check(motion)
        if self._settings.mode == "profile":
            return player.walk(motion)
        return self._streamed(player, motion, player.begin(motion))

    def make_safe(self) -> None:
        """Stop on the quick-stop ramp, and hold."""
        if self._drive is not None and self._bus.network is not None:
            self._drive.stop()

    def _streamed(
        self, player: Player, motion: Motion, start: float
    ) -> Generator[Samples, None, None]:
        """Follow the motion on the SYNC, from standstill at an angle [rad] to standstill."""
        grid, follower = self._grid(motion), self._follower(player.channel, motion, start)
        back, end = (follower.angle(grid.phase(n)) for n in (grid.farthest_back, grid.end))
        refuse_turns(self._settings.turns, self._name, back, end)
        with self._bus.streaming(self._name):
            player.stepper.move_to(start)
            follower.take_up()
            yield from self._played(Stream(grid, follower))
        player.ended(motion, end)

    def _played(self, stream: Stream) -> Generator[Samples, None, None]:
        """Yield samples; what the bus answered to the SYNC of each is for sensors to read."""
        self.timing = stream.timing
        try:
            for samples, answers in stream.chunks():
                self._device.refuse_trouble()
                self._bus.latched = answers
                yield samples
        finally:
            self._bus.latched = None
            if stream.timing.lost:
                log.warning("%s: %d cycles of the SYNC were late", self._name, stream.timing.lost)

    def _grid(self, motion: Motion) -> Grid:
        period = self._bus.settings.sync_period
        return Grid(motion, self._stride(motion), round(self._settings.ramp / period), period)

    def _follower(self, channel: Channel, motion: Motion, start: float) -> CanopenFollower:
        """Return the drive, to play from an angle [rad] on where the motion's settling begins."""
        if self._pdos is None:
            raise DeviceError(f"{self._name}: not connected")
        settles = motion.direction.sign * TURN * motion.settle_periods
        return CanopenFollower(
            self._connected(),
            self._device,
            self._pdos,
            channel,
            start - float(channel.samples[0]) + settles,
            self._settings.following_error,
        )

    def _stride(self, motion: Motion) -> int:
        """Return the cycles of the SYNC in a sample; InputError if it is no whole number."""
        sync_hz = 1 / self._bus.settings.sync_period
        ratio = sync_hz / (motion.period_rate_hz * motion.samples_per_period)
        stride = max(1, round(ratio))
        if abs(ratio / stride - 1) > GRID_TOLERANCE:
            fits = sync_hz / motion.samples_per_period
            near = " or ".join(
                f"{fits / n:.10g} Hz" for n in sorted({stride, max(1, math.floor(ratio))})
            )
            message = (
                f"{motion.samples_per_period} samples a cycle are not on the SYNC's grid of "
                f"{format_si(1 / sync_hz, 's', 4)}; take {near}, or another sync_period or "
                "samples_per_period"
            )
            got = f"{motion.period_rate_hz:g} Hz"
            raise InputError(Problem(message, "motion.period_rate", got=got))
        return stride

    def _configure(self, drive: Cia402Drive) -> None:
        """Tell the drive its limits and what to do in trouble."""
        settings, device = self._settings, self._device
        counts = drive.counts_per_revolution
        device.write("quick_stop_option", QUICK_STOP_AND_HOLD)
        device.write("connection_lost_option", QUICK_STOP_WHEN_ALONE)
        device.write("following_window", round(settings.following_error / TURN * counts))
        device.write("following_timeout", FOLLOWING_TIMEOUT_MS)
        if settings.turns is not None:
            device.write("lowest_position", math.floor(settings.turns.min * counts))
            device.write("highest_position", math.ceil(settings.turns.max * counts))
        self._set_interpolation(self._bus.settings.sync_period)

    def _set_interpolation(self, period_s: float) -> None:
        """Tell the drive the SYNC's period: value times 10 to the exponent, in s."""
        for exponent in range(-2, -7, -1):
            value = round(period_s / 10.0**exponent)
            if 1 <= value <= 255 and math.isclose(value * 10.0**exponent, period_s, rel_tol=1e-9):
                self._device.write("interpolation_value", value)
                self._device.write("interpolation_exponent", exponent)
                return
        raise DeviceError(
            f"{self._name}: a SYNC of {format_si(period_s, 's')} cannot be told to the drive "
            "(60C2h); take a round one, such as 4 ms"
        )

    def _counts_per_revolution(self) -> int:
        """Return the counts in a revolution; DeviceError if bench and drive disagree."""
        given = self._settings.counts_per_revolution
        told = counts_per_revolution(self._device.find)
        if given is not None and told != given:
            raise DeviceError(
                f"{self._name}: the bench says {given} counts_per_revolution, the drive {told} "
                "(60A8h, 6091h, 6092h, 608Fh); set the drive or correct the bench"
            )
        return told

    def _connected(self) -> Cia402Drive:
        if self._drive is None:
            raise DeviceError(f"{self._name}: not connected")
        return self._drive

    def _connected_player(self) -> Player:
        """Return what moves the drive; DeviceError if it is not as it was when it was connected."""
        if self._player is None:
            raise DeviceError(f"{self._name}: not connected")
        self._device.refuse_trouble()
        return self._player
