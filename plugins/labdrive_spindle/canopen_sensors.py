"""Sensors on a CAN bus: a CiA 406 encoder, and what a drive tells of itself."""

from typing import Literal

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Length
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_device import CanopenDevice
from labdrive_spindle.canopen_objects import DRIVE, ENCODER, ENCODER_PROFILE
from labdrive_spindle.links import bus_of, claim_node

NANOMETRE = 1e-9
# Types of encoder in object 1000h, CiA 406.
ROTARY = range(1, 6)


class CanopenEncoder:
    """Linear encoder by CiA 406: on the SYNC where the actuator streams, else when asked."""

    class Settings(SettingsBase):
        """Where it is, and what a count means."""

        link: str = Field(description="The bench's bus that the encoder is on.")
        node: int = Field(ge=1, le=127, description="Its node number on the bus.")
        step: Length | None = Field(
            default=None, gt=0, description="Travel a count; read from object 6501h by default."
        )
        inverted: bool = Field(default=False, description="True if it counts against the travel.")

    unit = "m"
    samplings = frozenset({Sampling.TRIGGERED, Sampling.POLLED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._name = context.name
        self._bus = bus_of(context, "sensors", settings.link, CanBus, "can-bus")
        claim_node(self._bus, settings.node, "sensors", context.name)
        self._device = CanopenDevice(self._bus, settings.node, context.name, ENCODER)
        self._identifier = 0
        self._step = 0.0

    def connect(self) -> None:
        """Reach the encoder; have it send its position after each SYNC."""
        settings, device = self._settings, self._device
        device.connect(ENCODER_PROFILE)
        step = settings.step or NANOMETRE * self._measuring_step()
        self._step = -step if settings.inverted else step
        device.silence_pdos()
        device.silence(1)
        self._identifier = device.map_sent(2, [ENCODER["position"]])
        self._bus.expect(self._identifier, self._name)
        device.start(watch_master=False)

    def _measuring_step(self) -> int:
        """Return object 6501h [nm]; DeviceError for a rotary encoder: there it counts a turn."""
        if self._device.type in ROTARY:
            raise DeviceError(
                f"{self._name}: node {self._settings.node} is a rotary encoder; say what travel a "
                "count is: `step`"
            )
        return self._device.read("measuring_step")

    def close(self) -> None:
        """Leave it, connected or not."""
        self._device.release()

    def read_at_rest(self) -> float:
        """Return the position now [m]."""
        return self._step * self._device.read("position")

    def arm(self, _acquisition: Acquisition) -> None:
        """Nothing to get ready: the SYNC latches it."""

    def read(self, samples: Samples) -> Reading:
        """Return the position [m] latched by each sample's SYNC, or as it is now."""
        self._device.refuse_trouble()
        latched = self._bus.latched
        if latched is None:
            return Reading(np.array([self.read_at_rest()]), samples.time[-1:])
        sent = [self._device.whole(answers[self._identifier], 4) for answers in latched]
        counts = [ENCODER["position"].decode(data) for data in sent]
        return Reading(self._step * np.array(counts, dtype=np.float64), samples.time)


class CanopenDriveSensor:
    """What the drive itself knows: its motor's angle, or how far that is behind."""

    class Settings(SettingsBase):
        """Which drive, and what of it."""

        link: str = Field(description="The bench's bus that the drive is on.")
        node: int = Field(ge=1, le=127, description="Node number of a `spindle-canopen`.")
        quantity: Literal["position", "following_error"] = "following_error"
        counts_per_revolution: int = Field(ge=16, description="Of the drive's position.")

    unit = "rad"
    samplings = frozenset({Sampling.TRIGGERED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._name = context.name
        self._bus = bus_of(context, "sensors", settings.link, CanBus, "can-bus")
        # Where `spindle-canopen` has its drive put them.
        first, start = (0x180, 2) if settings.quantity == "position" else (0x280, 0)
        self._identifier, self._start = first + settings.node, start

    def connect(self) -> None:
        """Nothing to do: the actuator has it sent."""

    def close(self) -> None:
        """Nothing to release."""

    def arm(self, _acquisition: Acquisition) -> None:
        """Nothing to get ready."""

    def read(self, samples: Samples) -> Reading:
        """Return the angle [rad] latched by each sample's SYNC."""
        latched = self._bus.latched or ()
        wanted = DRIVE[self._settings.quantity]
        if latched and self._identifier not in latched[0]:
            raise DeviceError(
                f"{self._name}: nothing came from node {self._settings.node}; it must be that of "
                "the bench's spindle-canopen which moves"
            )
        counts = [wanted.decode(answers[self._identifier][self._start :]) for answers in latched]
        scale = TURN / self._settings.counts_per_revolution
        return Reading(scale * np.array(counts, dtype=np.float64), samples.time[: len(counts)])
