"""A CiA 402 drive that follows set-points on the SYNC (cyclic synchronous position)."""

from dataclasses import dataclass

import numpy as np

from labdrive.model.errors import DeviceError
from labdrive.model.units import format_si
from labdrive.model.waveform import TURN, Channel
from labdrive_spindle.canopen_device import CanopenDevice
from labdrive_spindle.canopen_objects import DRIVE
from labdrive_spindle.cia402 import ENABLE_OPERATION, FOLLOWING_ERROR, FOLLOWS, Mode
from labdrive_spindle.cia402_drive import Cia402Drive
from labdrive_spindle.spindle import phase_of
from labdrive_spindle.streaming import Answers


@dataclass(frozen=True)
class Pdos:
    """The identifiers of a drive's PDOs: set-points out; status and position, and errors, in."""

    set_points: int
    status: int
    errors: int


def map_pdos(device: CanopenDevice) -> Pdos:
    """Lay out the PDOs, and have the bus await those that come in."""
    device.silence_pdos()
    pdos = Pdos(
        device.map_received(1, [DRIVE["controlword"], DRIVE["target_position"]]),
        device.map_sent(1, [DRIVE["statusword"], DRIVE["position"]]),
        device.map_sent(2, [DRIVE["following_error"], DRIVE["error_code"]]),
    )
    for number in (3, 4):
        device.silence(number)
    for identifier in (pdos.status, pdos.errors):
        device.bus.expect(identifier, device.name)
    return pdos


@dataclass(frozen=True)
class CanopenFollower:
    """Turns a drive to the angles that a channel has, from `base` [rad] on; a `Follower`.

    `following_error` [rad] is the largest that is allowed.
    """

    drive: Cia402Drive
    device: CanopenDevice
    pdos: Pdos
    channel: Channel
    base: float
    following_error: float

    def angle(self, phase: float) -> float:
        """Return the angle [rad] from home at a phase [rad]."""
        return float(self.channel.at(np.array([phase]))[0]) + self.base

    def take_up(self) -> None:
        """Have the drive follow set-points from where it was sent last."""
        self.drive.use(Mode.CYCLIC_POSITION)
        self.drive.enable()

    def exchange(self, phase: float) -> Answers:
        """Send a phase [rad] with the SYNC; return the answers of all devices.

        DeviceError if the drive has a fault, does not drive, or is at a limit of its own.
        """
        target = DRIVE["target_position"].encode(round(self.angle(phase) * self._counts))
        set_point = ENABLE_OPERATION.to_bytes(2, "little") + target
        answers = self.device.bus.cycle([(self.pdos.set_points, set_point)])
        self.drive.machine.refuse_idle(self._statusword(answers))
        return answers

    def reached(self, answers: Answers) -> float:
        """Return the phase [rad] that the motor has; DeviceError if the drive does not follow."""
        self._refuse_lag(answers)
        angle = DRIVE["position"].decode(answers[self.pdos.status][2:]) / self._counts
        if not self._statusword(answers) & FOLLOWS:
            raise DeviceError(
                f"{self.device.name}: the drive ignores the set-points (statusword bit 12)"
            )
        return float(phase_of(self.channel, np.array([angle - self.base]))[0])

    def leave(self) -> None:
        """Have the drive hold its position by itself: set-points that stop would be a fault."""
        self.drive.use(Mode.PROFILE_POSITION)

    @property
    def _counts(self) -> float:
        """Counts in a radian."""
        return self.drive.counts_per_revolution / TURN

    def _statusword(self, answers: Answers) -> int:
        return DRIVE["statusword"].decode(self.device.whole(answers[self.pdos.status], 6))

    def _refuse_lag(self, answers: Answers) -> None:
        """Raise DeviceError if the motor is too far behind, as the drive or labdrive has it."""
        errors = self.device.whole(answers[self.pdos.errors], 6)
        lag, most = DRIVE["following_error"].decode(errors) / self._counts, self.following_error
        if self._statusword(answers) & FOLLOWING_ERROR or abs(lag) > most:
            raise DeviceError(
                f"{self.device.name}: the drive does not follow: it is "
                f"{format_si(lag, 'rad', 3)} behind, {format_si(most, 'rad', 3)} are allowed; go "
                "slower, or look for what holds it"
            )
