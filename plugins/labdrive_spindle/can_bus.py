"""The link `can-bus`: a CANopen network on any python-can interface, its SYNC and its heartbeat."""

import contextlib
import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from threading import Condition, Event, Thread
from typing import Any

from pydantic import Field, field_validator

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Time
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError
from labdrive.model.wording import no_such

log = logging.getLogger(__name__)

SYNC = 0x80
HEARTBEAT = 0x700
TOGGLE = 0x80
OPERATIONAL = 5
# Beyond what the slowest of answers takes on a bus that carries nothing else.
LATE_S = 0.2
FLOODED_PER_S = 2000
# Function codes of what devices send: emergencies, PDOs, SDO answers, heartbeats.
DEVICES = frozenset({0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700})
RECENT_S = 1.0
# How often the receiving thread looks whether the bus was closed.
LOOK_S = 0.05

Frame = tuple[int, bytes]


class CanBus:
    """Shares one bus among its devices, and gathers what they send after each SYNC.

    canopen's own classes for CiA 402 and for PDOs are not used: see docs/decisions/0012.
    """

    class Settings(SettingsBase):
        """Where the bus is: what python-can needs to open it."""

        interface: str = Field(description="A python-can interface: socketcan, pcan, socketcand.")
        channel: str | int = Field(description="As the interface calls it: can0, PCAN_USBBUS1.")
        bitrate: int | None = Field(default=None, ge=10_000, le=1_000_000, description="In bit/s.")
        options: dict[str, str | int | float | bool] = Field(
            default_factory=dict, description="More for python-can: host, port, tcp_tune."
        )
        sync_period: Time = Field(default=4e-3, ge=1e-3, le=0.1, description="Of the SYNC.")
        own_node: int = Field(
            default=127, ge=1, le=127, description="Node number of this computer's heartbeat."
        )
        heartbeat: Time = Field(
            default=0.1, ge=1e-3, le=10, description="How often each side shows that it is there."
        )
        patience: Time = Field(
            default=0.5, gt=0, le=60, description="How long an answer may take, by SDO."
        )

        @field_validator("interface")
        @classmethod
        def _known(cls, interface: str) -> str:
            from can import VALID_INTERFACES

            if interface not in VALID_INTERFACES:
                raise ValueError(no_such("interface", interface, sorted(VALID_INTERFACES)))
            return interface

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self.settings = settings
        self.name = context.name
        self.latched: Sequence[Mapping[int, bytes]] | None = None
        self.network: Any = None
        self.claimed: dict[int, str] = {}
        self._expected: dict[int, str] = {}
        self._received: dict[int, bytes] = {}
        self._complete = Condition()
        self._closed = Event()
        self._heard: dict[int, float] = {}
        self._toggle: dict[int, int] = {}
        self._strange: Counter[int] = Counter()
        self._strange_since = 0.0
        self._streams: str | None = None
        self._foreign_sync = False

    def connect(self) -> None:
        """Open the bus and show signs of life; DeviceError if it cannot be opened."""
        import can
        from canopen import Network

        # What goes wrong below is told here, in words, and not twice.
        logging.getLogger("can").setLevel(logging.CRITICAL)
        logging.getLogger("canopen").setLevel(logging.CRITICAL)
        settings = self.settings
        more: dict[str, Any] = dict(settings.options)
        if settings.bitrate is not None:
            more["bitrate"] = settings.bitrate
        try:
            bus = can.Bus(settings.channel, settings.interface, **more)
        except (can.CanError, OSError, TypeError, ValueError, ImportError) as error:
            given = ", ".join(f"{name} {value}" for name, value in more.items())
            raise DeviceError(
                f"{self.name}: {settings.interface} {settings.channel} cannot be opened"
                f"{f' ({given})' if given else ''}: {error}; is it there, and switched on?"
            ) from error
        self._expected = {}
        self.network = Network(bus)
        self.network.NOTIFIER_CYCLE = LOOK_S
        self.network.connect()
        self.network.notifier.add_listener(_Ear(self._hear))
        self._closed.clear()
        Thread(target=self._beat, name="heartbeat", daemon=True).start()

    def close(self) -> None:
        """Fall silent and leave the bus, open or not."""
        network, self.network = self.network, None
        if network is None:
            return
        self._closed.set()
        with contextlib.suppress(Exception):
            network.disconnect()

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; DeviceError if the bus does not take it."""
        import can

        if self.network is None:
            raise DeviceError(f"{self.name}: the bus is not open")
        try:
            self.network.send_message(can_id, data)
        except (can.CanError, OSError) as error:
            raise DeviceError(
                f"{self.name}: the bus takes no frames ({error}); is it unplugged?"
            ) from error

    def expect(self, can_id: int, device: str) -> None:
        """Wait, in each cycle, for what `device` sends under this identifier after the SYNC."""
        if can_id not in self._expected:
            self._expected[can_id] = device
            self.network.subscribe(can_id, self._take)

    @contextlib.contextmanager
    def streaming(self, actuator: str) -> Iterator[None]:
        """Leave the SYNC to one actuator; DeviceError if another one has it."""
        if self._streams is not None:
            raise DeviceError(
                f"{self.name}: {actuator} cannot be streamed to while {self._streams} is: the SYNC "
                "would come twice; give each drive a bus of its own, or move one after the other"
            )
        self._streams, self._foreign_sync = actuator, False
        try:
            yield
        finally:
            self._streams = None

    def cycle(self, frames: Sequence[Frame]) -> dict[int, bytes]:
        """Send frames and the SYNC; return what every expected identifier answered to it.

        The answers to one SYNC are taken as a set: none is from another cycle. DeviceError if one
        does not come in time, or somebody else sends the SYNC.
        """
        if self._foreign_sync:
            raise DeviceError(
                f"{self.name}: another device sends the SYNC, too; there can be one only: clear "
                "bit 30 of its object 1005h, or set its 1006h to 0"
            )
        with self._complete:
            self._received = {}
        sent = time.monotonic()
        for can_id, data in frames:
            self.send(can_id, data)
        self.send(SYNC, b"")
        if self._answered(max(LATE_S, 5 * self.settings.sync_period)):
            return self._received
        missing = self._expected.keys() - self._received
        who = ", ".join(sorted({self._expected[identifier] for identifier in missing}))
        if self._answered(self.settings.patience):
            late = time.monotonic() - sent
            raise DeviceError(
                f"{self.name}: {who} answered the SYNC {1000 * late:.0f} ms late; is the bus "
                "overloaded?"
            )
        why = self.why_silent(sent, {identifier & 0x7F for identifier in missing})
        raise DeviceError(f"{self.name}: {who} did not answer the SYNC; {why}")

    def _answered(self, seconds: float) -> bool:
        """Wait for all answers; return whether they are there."""
        with self._complete:
            return self._complete.wait_for(self._have_all, seconds)

    def expect_toggle(self, node: int) -> None:
        """Take a node's answers to guarding for signs of life only if their toggle bit changes.

        A CAN controller can answer the remote frames of guarding by itself when its processor is
        dead; it then repeats the last answer (CiA 301, node guarding protocol).
        """
        self._toggle[HEARTBEAT + node] = TOGGLE

    def silent_for(self, node: int) -> float:
        """Return how long a node has shown no sign of life, in s; infinite if it never has."""
        heard = self._heard.get(HEARTBEAT + node)
        return float("inf") if heard is None else time.monotonic() - heard

    def why_silent(self, since: float, awaited: AbstractSet[int]) -> str:
        """Return what the bus has carried since a moment that says why nodes did not answer."""
        seconds = max(0.1, time.monotonic() - self._strange_since)
        if self._strange.total() / seconds > FLOODED_PER_S:
            busiest, count = self._strange.most_common(1)[0]
            return (
                f"the bus is flooded: {self._strange.total() / seconds:.0f} frames/s that are none "
                f"of ours, {count / self._strange.total():.0%} of them under identifier "
                f"0x{busiest:03X}; find who sends them"
            )
        heard = {can_id & 0x7F for can_id, when in self._heard.items() if when > since}
        if there := heard & awaited:
            return f"node {_listed(there)} is there, but answers late, or not to this"
        if heard:
            return f"heard instead: node {_listed(heard)}; is the node number right?"
        return "nobody was heard: check the cable, termination, bit rate and supply"

    def _have_all(self) -> bool:
        return len(self._received) == len(self._expected)

    def _take(self, can_id: int, data: bytes, _time: float) -> None:
        with self._complete:
            self._received[can_id] = bytes(data)
            if self._have_all():
                self._complete.notify_all()

    def _hear(self, message: Any) -> None:
        """Note who is there, and how much the bus carries that is not known."""
        now, can_id = time.monotonic(), message.arbitration_id
        if not message.is_rx:
            return  # a frame of ours that the bus echoes
        if can_id == SYNC:
            self._foreign_sync = True
        elif can_id & 0x780 in DEVICES:
            if self._is_stale(message):
                return
            self._heard[can_id] = now
        else:
            if now - self._strange_since > RECENT_S:
                self._strange, self._strange_since = Counter(), now
            self._strange[can_id] += 1

    def _is_stale(self, message: Any) -> bool:
        """Return whether this repeats an answer to guarding, toggle bit and all."""
        last = self._toggle.get(message.arbitration_id)
        if last is None or not message.data:
            return False
        now: int = message.data[0] & TOGGLE
        self._toggle[message.arbitration_id] = now
        return now == last

    def _beat(self) -> None:
        """Show that this computer is there, until the bus is closed."""
        identifier = HEARTBEAT + self.settings.own_node
        while not self._closed.wait(self.settings.heartbeat):
            with contextlib.suppress(DeviceError):  # whoever waits for an answer is told
                self.send(identifier, bytes([OPERATIONAL]))


class _Ear:
    """A listener of python-can's. Errors of receiving are told to whoever waits for an answer."""

    def __init__(self, hear: Callable[[Any], None]) -> None:
        self._hear = hear

    def __call__(self, message: Any) -> None:
        self._hear(message)

    def on_error(self, error: Exception) -> None:
        """Take note, so that no thread dies loudly."""
        log.debug("receiving failed: %s", error)

    def stop(self) -> None:
        """Nothing to release."""


def _listed(nodes: AbstractSet[int]) -> str:
    return ", ".join(map(str, sorted(nodes)))
