"""Walk a motion step by step: move, settle, read. For buses too slow to stream set-points."""

import time
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from labdrive.interfaces.devices import Samples
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN, Channel
from labdrive_spindle.spindle import Homing, Profile, phase_of

LOOK_S = 0.002
SHOW_S = 0.2
SLOWEST_RPS = 1e-3
# Near enough to a target for what following and settling leave: a fraction of a revolution, and
# counts for drives whose count is a large part of it.
NEAR = 1 / 50
NEAR_COUNTS = 2
COMES_NEAR_S = 0.5


class Drive(Protocol):
    """A drive that moves by itself. Positions are in counts."""

    @property
    def counts_per_revolution(self) -> float:
        """Counts in a revolution, whole or not."""

    @property
    def position(self) -> int:
        """Where the motor stands."""

    def start(self, counts: int) -> None:
        """Begin to move to a position; energize the motor first, if that was not done."""

    def arrived(self) -> bool:
        """Whether it says that it is there; DeviceError for whatever is wrong with the drive."""

    def stop(self) -> None:
        """Stop at once, and hold."""

    def prepare(self, profile: Profile) -> int:
        """Set it up, and energize nothing.

        Return the fault of an earlier time, which is acknowledged, or 0.
        """

    def home(self, homing: Homing) -> None:
        """Find its home; DeviceError if it does not."""

    def check(self) -> None:
        """Raise DeviceError, in words, if it has a fault."""


@dataclass
class Stepper:
    """Moves a drive to angles [rad] from its home. `patience_s` is beyond what a move takes."""

    drive: Drive
    velocity_hz: float
    settle_s: float
    patience_s: float = 5.0

    @property
    def angle(self) -> float:
        """Where the motor stands [rad]."""
        return TURN * self.drive.position / self.drive.counts_per_revolution

    def moving_to(self, angle: float) -> Generator[float, None, None]:
        """Move; yield the angle [rad] now and then on the way. Closing this stops the drive."""
        counts = round(angle / TURN * self.drive.counts_per_revolution)
        far = abs(counts - self.drive.position) / self.drive.counts_per_revolution
        self.drive.start(counts)
        give_up = time.monotonic() + far / max(self.velocity_hz, SLOWEST_RPS) + self.patience_s
        show = time.monotonic() + SHOW_S
        try:
            while not self.drive.arrived():
                self._refuse_later(give_up, angle)
                time.sleep(LOOK_S)
                if time.monotonic() > show:
                    yield self.angle
                    show = time.monotonic() + SHOW_S
            self._await_target(counts)
        except BaseException:
            # What went wrong first is told; whoever makes the bench safe stops the drive again.
            with suppress(DeviceError):
                self.drive.stop()
            raise

    def _refuse_later(self, give_up: float, angle: float) -> None:
        if time.monotonic() > give_up:
            raise DeviceError(
                f"the drive did not reach {angle / TURN:.4f} revolutions from home; it is "
                f"at {self.angle / TURN:.4f}: is it blocked, or too slow?"
            )

    def _await_target(self, target: int) -> None:
        """Raise DeviceError if a drive that says it has arrived stands elsewhere [counts]."""
        per_turn = self.drive.counts_per_revolution
        near = max(NEAR_COUNTS, NEAR * per_turn)
        position = self.drive.position
        until = time.monotonic() + COMES_NEAR_S
        while abs(position - target) > near:
            if time.monotonic() > until:
                raise DeviceError(
                    f"the drive says that it has arrived at {target / per_turn:.4f} revolutions "
                    f"from home, but stands at {position / per_turn:.4f}, "
                    f"{abs(position - target) / per_turn:.4f} away: is its motor energized and "
                    "free, and is the target within its own limits?"
                )
            self.drive.arrived()  # tells what is wrong with the drive, if it knows
            time.sleep(LOOK_S)
            position = self.drive.position

    def move_to(self, angle: float) -> None:
        """Move to an angle [rad] and be there."""
        for _ in self.moving_to(angle):
            pass

    def walk(
        self, channel: Channel, motion: Motion, start: float
    ) -> Generator[Samples, None, None]:
        """Step through a motion that begins at an angle [rad] where the table starts.

        Phases are those of the angles that were sent, in whole counts of the drive. Where the motor
        stands instead is part of the periodic error: a motor's cogging is found there.
        """
        started, sign, m = time.monotonic(), motion.direction.sign, motion.samples_per_period
        base = start - float(channel.samples[0]) + sign * TURN * motion.settle_periods
        for number in range(-motion.settle_periods * m, motion.periods * m + 1):
            phase = sign * TURN * number / m
            sent = self._whole(float(channel.at(np.array([phase]))[0]) + base)
            self.move_to(sent)
            time.sleep(self.settle_s)
            now = np.array([time.monotonic() - started])
            yield Samples(phase_of(channel, np.array([sent - base])), now, settling=number < 0)

    def _whole(self, angle: float) -> float:
        """Return the angle of the nearest count [rad]."""
        counts = self.drive.counts_per_revolution
        return TURN * round(angle / TURN * counts) / counts

    def go_back(self, angle: float, channel: Channel) -> Generator[Samples, None, None]:
        """Move to an angle [rad] in one go, unrecorded."""
        started = time.monotonic()
        for here in self.moving_to(angle):
            now = np.array([time.monotonic() - started])
            yield Samples(phase_of(channel, np.array([here])), now, settling=True)
        end = np.array([time.monotonic() - started])
        yield Samples(phase_of(channel, np.array([self.angle])), end, settling=True)
