"""A CANopen device on any python-can bus: SDO, NMT, heartbeat, guarding, PDOs on the SYNC.

What goes wrong on demand is here too: answers late, garbled, from another node, or none.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from threading import Event, Thread, Timer
from typing import Any

import can
from canopen import LocalNode, Network, ObjectDictionary, SdoAbortedError
from canopen.objectdictionary.datatypes import SIGNED_TYPES

from labdrive_sim.wire_faults import Faults

PDO_OFF = 0x80000000
SYNCHRONOUS = 240
NODE_GUARD = 0x700
SYNC = 0x80
NOT_NOW = 0x08000022


@dataclass
class Mapped:
    """A PDO as it is configured: where it goes, and the objects in it."""

    cob_id: int
    transmission: int
    objects: list[tuple[int, int, int]] = field(default_factory=list)


class Node:
    """One device. `read` and `write` reach what is behind its objects."""

    def __init__(
        self,
        node_id: int,
        objects: ObjectDictionary,
        read: Callable[[int, int], int | None],
        write: Callable[[int, int, int], None],
    ) -> None:
        self.id = node_id
        self._network = Network()
        self._node = LocalNode(node_id, objects)
        self._read, self._write = read, write
        self._tpdos: list[Mapped] = []
        self._listening: list[int] = []
        self._guarded = 0
        self.on_sync: Callable[[], None] | None = None
        self.on_lost_master: Callable[[], None] | None = None
        self._heard_master = time.monotonic()
        self._node.add_read_callback(self._on_read)
        self._node.add_write_callback(self._on_write)

    def join(self, network: Network) -> None:
        """Join a network and boot. Those that join first are the first to see a SYNC."""
        self._network = network
        network.add_node(self._node)
        network.subscribe(SYNC, self._synchronize)
        network.subscribe(0, self._on_nmt)
        network.notifier.add_listener(self._guard)  # type: ignore[union-attr]
        self.restart()

    def restart(self) -> None:
        """Boot again, as after a power cut."""
        self._node.nmt.state = "INITIALISING"
        self._node.nmt.state = "PRE-OPERATIONAL"

    def leave(self) -> None:
        """Send nothing any more by itself."""
        self._node.nmt.stop_heartbeat()

    @property
    def operational(self) -> bool:
        """Whether PDOs are exchanged."""
        return bool(self._node.nmt.state == "OPERATIONAL")

    def emergency(self, code: int) -> None:
        """Send an EMCY message."""
        self._node.emcy.send(code, register=0x01 if code else 0)

    def value(self, index: int, sub: int = 0) -> int:
        """Return an object as a number."""
        data = self._node.get_data(index, sub)
        return int.from_bytes(data, "little")

    def check_master(self) -> None:
        """Notice that the heartbeat (1016h) or guarding (100Ch, 100Dh) waited for is missing."""
        life_time = self.value(0x100C) * self.value(0x100D)
        limit = (life_time or self.value(0x1016, 1) & 0xFFFF) / 1000
        if limit and time.monotonic() - self._heard_master > limit:
            self._heard_master = time.monotonic()
            if self.on_lost_master is not None:
                self.on_lost_master()

    def _on_read(self, index: int, subindex: int, **_: Any) -> int | None:
        return self._read(index, subindex)

    def _on_write(self, index: int, subindex: int, data: bytes, **_: Any) -> None:
        if 0x1400 <= index < 0x1C00 and self.operational:
            raise SdoAbortedError(NOT_NOW)
        if (index, subindex) == (0x1016, 1):
            self._wait_for_master(int.from_bytes(data, "little"))
        elif index in {0x100C, 0x100D}:
            self._on_master()
        entry = self._node.object_dictionary.get_variable(index, subindex)
        signed = entry is not None and entry.data_type in SIGNED_TYPES
        self._write(index, subindex, int.from_bytes(data, "little", signed=signed))

    def _wait_for_master(self, consumer: int) -> None:
        self._heard_master = time.monotonic()
        if consumer & 0xFFFF:
            self._network.subscribe(0x700 + (consumer >> 16 & 0x7F), self._on_master)

    def _on_master(self, *_: Any) -> None:
        self._heard_master = time.monotonic()

    def _on_nmt(self, *_: Any) -> None:
        """Take up the PDO mapping when the device becomes operational."""
        if not self.operational:
            return
        for cob_id in self._listening:
            self._network.unsubscribe(cob_id)
        received = [pdo for n in range(4) if (pdo := self._mapped(0x1400 + n, 0x1600 + n))]
        self._listening = [pdo.cob_id for pdo in received]
        for pdo in received:
            self._network.subscribe(pdo.cob_id, partial(self._receive, pdo))
        self._tpdos = [pdo for n in range(4) if (pdo := self._mapped(0x1800 + n, 0x1A00 + n))]

    def _mapped(self, communication: int, mapping: int) -> Mapped | None:
        cob_id = self.value(communication, 1)
        if cob_id & PDO_OFF or not self.value(mapping, 0):
            return None
        pdo = Mapped(cob_id & 0x7FF, self.value(communication, 2))
        for sub in range(1, self.value(mapping, 0) + 1):
            entry = self.value(mapping, sub)
            pdo.objects.append((entry >> 16, entry >> 8 & 0xFF, (entry & 0xFF) // 8))
        return pdo

    def _receive(self, pdo: Mapped, _cob_id: int, data: bytes, _time: float) -> None:
        if sum(size for *_, size in pdo.objects) != len(data):
            self.emergency(0x8210)
            return
        at = 0
        for index, sub, size in pdo.objects:
            self._node.set_data(index, sub, bytes(data[at : at + size]))
            at += size

    def _synchronize(self, *_: Any) -> None:
        """Latch and send every synchronous TPDO, then let the device go on."""
        if not self.operational:
            return
        for pdo in self._tpdos:
            if pdo.transmission <= SYNCHRONOUS:
                self._send(pdo)
        if self.on_sync is not None:
            self.on_sync()

    def _send(self, pdo: Mapped) -> None:
        data = b"".join(self._node.get_data(index, sub) for index, sub, _ in pdo.objects)
        self._network.send_message(pdo.cob_id, data)

    def _guard(self, message: can.Message) -> None:
        """Answer node guarding: the state, with a bit that toggles."""
        if message.is_remote_frame and message.arbitration_id == NODE_GUARD + self.id:
            self._on_master()
            state = {"OPERATIONAL": 5, "STOPPED": 4}.get(self._node.nmt.state, 127)
            self._network.send_message(message.arbitration_id, bytes([state | self._guarded]))
            self._guarded ^= 0x80


class FaultyBus:
    """A bus as devices with faults use it."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self.faults = Faults()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        """Send a frame, or what has become of it."""
        faults = self.faults
        if faults.silent:
            return
        if faults.garble and message.arbitration_id & 0x780 in {0x180, 0x280, 0x380, 0x480}:
            message.data = message.data[:3]
            message.dlc = len(message.data)
        if faults.as_node is not None:
            message.arbitration_id = message.arbitration_id & 0x780 | faults.as_node
        if faults.delay_s:
            Timer(faults.delay_s, self._send_late, [message]).start()
        else:
            self._bus.send(message, timeout)

    def _send_late(self, message: can.Message) -> None:
        with suppress(can.CanError):  # the bus may have been closed since
            self._bus.send(message)

    def send_periodic(self, message: can.Message, period: float) -> "_Repeated":
        """Send a frame again and again, by way of `send`."""
        return _Repeated(self, message, period)


class _Repeated:
    """A frame that is sent again and again from a thread of its own."""

    def __init__(self, bus: FaultyBus, message: can.Message, period: float) -> None:
        self._bus, self._message, self._period = bus, message, period
        self._stopped = Event()
        Thread(target=self._run, daemon=True).start()

    def stop(self) -> None:
        """Send no more."""
        self._stopped.set()

    def modify_data(self, message: can.Message) -> None:
        """Send this from now on."""
        self._message = message

    def _run(self) -> None:
        while not self._stopped.wait(self._period):
            one = self._message
            copy = can.Message(
                arbitration_id=one.arbitration_id, data=one.data, is_extended_id=False
            )
            self._bus.send(copy)


def flood(bus: can.BusABC, seconds: float) -> None:
    """Fill a bus with frames of high priority."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        bus.send(can.Message(arbitration_id=0x001, data=bytes(8), is_extended_id=False))
