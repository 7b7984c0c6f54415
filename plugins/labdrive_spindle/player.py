"""Plays a table step by step with a drive that moves by itself."""

from collections.abc import Generator

from labdrive.interfaces.devices import Samples
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.waveform import Channel, WaveformTable
from labdrive_spindle.spindle import SpindleSettings, angle_channel, nearest_turn, refuse_turns
from labdrive_spindle.stepping import Drive, Stepper


class Player:
    """Holds a table, and remembers where the motion that was walked last began."""

    def __init__(self, drive: Drive, settings: SpindleSettings, name: str) -> None:
        self.stepper = Stepper(drive, settings.profile.velocity, settings.settle)
        self._homing = settings.homing
        self._turns = settings.turns
        self._name = name
        self._channel: Channel | None = None
        self._returns_to: float | None = None
        self._overrun = 0.0

    @property
    def channel(self) -> Channel:
        """The angle that is played; DeviceError if none was loaded."""
        if self._channel is None:
            raise DeviceError(f"{self._name}: there is no table to play; load one first")
        return self._channel

    def reference(self) -> None:
        """Find the home, once a connection; DeviceError if the drive has a fault."""
        self.stepper.drive.check()
        if self._homing is not None:
            self.stepper.drive.home(self._homing)
            self._homing = None

    def load(self, table: WaveformTable) -> None:
        """Turn to the nearest start of the table, which is played from now on."""
        channel = angle_channel(table)
        start = self._start(channel)
        refuse_turns(self._turns, self._name, start)
        self._move_to(start)
        self._channel = channel

    def turn_to(self, angle: float) -> None:
        """Turn to an angle [rad] from home; DeviceError if it is beyond the drive's range."""
        refuse_turns(self._turns, self._name, angle)
        self._move_to(angle)

    def begin(self, motion: Motion) -> float:
        """Return the angle [rad] at which a motion begins, where the table starts.

        That nearest to where the last one ended, however far the motor ran on to slow down.
        DeviceError if the motion would leave the drive's range.
        """
        start = self._start(self.channel)
        refuse_turns(self._turns, self._name, start, start + motion.phase_span)
        self._returns_to, self._overrun = start, 0.0
        return start

    def ended(self, motion: Motion, at: float) -> None:
        """Take note that the motion has come to rest, at an angle [rad] beyond its end."""
        if self._returns_to is not None:
            self._overrun = at - (self._returns_to + motion.phase_span)

    def walk(self, motion: Motion) -> Generator[Samples, None, None]:
        """Step through a motion."""
        return self.stepper.walk(self.channel, motion, self.begin(motion))

    def walk_back(self, motion: Motion) -> Generator[Samples, None, None]:
        """Return, in one go, to where the last motion began; or walk `motion` if there was none."""
        back = self._returns_to
        if back is None:
            back = self._start(self.channel) + motion.phase_span
        refuse_turns(self._turns, self._name, back)
        self._overrun = 0.0
        return self.stepper.go_back(back, self.channel)

    def _move_to(self, angle: float) -> None:
        self._overrun = 0.0
        self.stepper.move_to(angle)

    def _start(self, channel: Channel) -> float:
        here = self.stepper.angle - self._overrun
        return float(channel.samples[0]) + nearest_turn(channel, here)
