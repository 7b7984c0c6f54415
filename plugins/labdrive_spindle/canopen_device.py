"""One CANopen device: its objects by SDO, its PDOs, its heartbeat and its emergencies."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from threading import RLock
from typing import Any

from labdrive.model.errors import DeviceError
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.fault_words import words_for

PDO_OFF = 1 << 31
NO_REMOTE = 1 << 30
ON_EVERY_SYNC = 1
MISSED_HEARTBEATS = 4
OPERATIONAL = "OPERATIONAL"


@dataclass(frozen=True)
class Object:
    """An entry of an object dictionary."""

    index: int
    sub: int
    bits: int
    signed: bool = False

    def __str__(self) -> str:
        """Return it as manuals write it: 6041h, 607Dh:1."""
        return f"{self.index:04X}h" + (f":{self.sub}" if self.sub else "")

    def decode(self, data: bytes) -> int:
        """Return the value that bytes hold, least significant first."""
        return int.from_bytes(data[: self.bits // 8], "little", signed=self.signed)

    def encode(self, value: int) -> bytes:
        """Return the bytes of a value; DeviceError if it does not fit."""
        try:
            return int(value).to_bytes(self.bits // 8, "little", signed=self.signed)
        except OverflowError as error:
            kind = f"{self.bits} bits{' with a sign' if self.signed else ''}"
            raise DeviceError(f"{value} does not fit object {self} of {kind}") from error


DEVICE_TYPE = Object(0x1000, 0, 32)
MASTER_WATCHED = Object(0x1016, 1, 32)
HEARTBEAT_TIME = Object(0x1017, 0, 16)
GUARD_TIME = Object(0x100C, 0, 16)
LIFE_FACTOR = Object(0x100D, 0, 8)
VENDOR, PRODUCT = Object(0x1018, 1, 32), Object(0x1018, 2, 32)


class CanopenDevice:
    """A node of a bus. `objects` are its own by name; implements `cia402.Objects`.

    `type`: what the upper half of object 1000h says of it, by its profile.
    """

    def __init__(self, bus: CanBus, node: int, name: str, objects: Mapping[str, Object]) -> None:
        self.bus, self.node, self.name = bus, node, name
        self._objects = objects
        self._remote: Any = None
        self._lock = RLock()
        self._emergency: int | None = None
        self.type = 0

    def connect(self, profile: int, eds: str | None = None) -> None:
        """Reach the device; DeviceError if nobody answers, or something of another profile.

        A DCF's values are written to the device.
        """
        if self.bus.network is None:
            raise DeviceError(f"{self.name}: the bus {self.bus.name} is not open")
        self._remote = self._added(eds)
        self._remote.sdo.RESPONSE_TIMEOUT = self.bus.settings.patience
        self._remote.emcy.add_callback(self._on_emergency)
        told = self.get(DEVICE_TYPE)
        self.type, kind = told >> 16, told & 0xFFFF
        if kind != profile:
            raise DeviceError(
                f"{self.name}: node {self.node} is a device of profile {kind}, not of {profile}; "
                "is the node number right?"
            )
        self._emergency = None
        if eds is not None:
            self._load(eds)

    def _added(self, eds: str | None) -> Any:
        from configparser import Error

        try:
            return self.bus.network.add_node(self.node, eds)
        except (Error, ValueError, KeyError, OSError) as error:
            first = str(error).splitlines()[0]
            raise DeviceError(f"{self.name}: {eds} is no EDS or DCF: {first}") from error

    def read(self, name: str) -> int:
        """Return the object of that name."""
        return self.get(self._objects[name])

    def write(self, name: str, value: int) -> None:
        """Write the object of that name."""
        self.put(self._objects[name], value)

    def has(self, name: str) -> bool:
        """Whether there is an object of that name."""
        return name in self._objects

    def get(self, wanted: Object) -> int:
        """Return an object by SDO; DeviceError if it does not come."""
        data = self._ask(f"read {wanted}", self._upload, wanted)
        if len(data) * 8 < wanted.bits:
            raise DeviceError(
                f"{self.name}: node {self.node} gave {len(data)} bytes for {wanted}, where "
                f"{wanted.bits // 8} are due"
            )
        return wanted.decode(data)

    def find(self, name: str) -> int | None:
        """Return the object of that name by SDO; None if the device has none."""
        try:
            return self.read(name)
        except DeviceError:
            self.get(DEVICE_TYPE)  # it does not have it, but is still there
            return None

    def put(self, wanted: Object, value: int) -> None:
        """Write an object by SDO; DeviceError if the device does not take it."""
        data = wanted.encode(value)
        self._ask(f"write {value} to {wanted}", self._download, wanted, data)

    def _upload(self, wanted: Object) -> bytes:
        return bytes(self._remote.sdo.upload(wanted.index, wanted.sub))

    def _download(self, wanted: Object, data: bytes) -> bytes:
        self._remote.sdo.download(wanted.index, wanted.sub, data)
        return b""

    def _ask(self, what: str, transfer: Any, *given: Any) -> bytes:
        from can import CanError
        from canopen import SdoAbortedError, SdoCommunicationError

        if self._remote is None:
            raise DeviceError(f"{self.name}: not connected")
        asked = time.monotonic()
        try:
            with self._lock:
                answer: bytes = transfer(*given)
        except SdoAbortedError as error:
            message = f"{self.name}: node {self.node} refuses to {what}: {error}"
            raise DeviceError(message) from error
        except (SdoCommunicationError, CanError, OSError) as error:
            raise DeviceError(
                f"{self.name}: node {self.node} does not answer ({what}); "
                f"{self.bus.why_silent(asked, {self.node})}"
            ) from error
        return answer

    def whole(self, data: bytes, size: int) -> bytes:
        """Return what a PDO brought; DeviceError if it has not the bytes it was mapped to."""
        if len(data) != size:
            raise DeviceError(
                f"{self.name}: node {self.node} sent a PDO of {len(data)} bytes where {size} are "
                "due; was its mapping changed, or are frames garbled?"
            )
        return data

    def silence_pdos(self) -> None:
        """Leave operation: many devices let their PDOs be mapped in no other state."""
        self._remote.nmt.state = "PRE-OPERATIONAL"

    def map_sent(self, number: int, objects: Sequence[Object]) -> int:
        """Have the device send objects after each SYNC; return the identifier they come under."""
        cob_id = 0x80 + 0x100 * number + self.node
        self._map(0x1800 + number - 1, 0x1A00 + number - 1, cob_id | NO_REMOTE, objects)
        return cob_id

    def map_received(self, number: int, objects: Sequence[Object]) -> int:
        """Have the device take objects at each SYNC; return the identifier to send them under."""
        cob_id = 0x100 + 0x100 * number + self.node
        self._map(0x1400 + number - 1, 0x1600 + number - 1, cob_id, objects)
        return cob_id

    def silence(self, number: int) -> None:
        """Have the device not send the PDO of that number, if it has one."""
        entry = Object(0x1800 + number - 1, 1, 32)
        try:
            self.put(entry, self.get(entry) | PDO_OFF)
        except DeviceError:
            self.get(DEVICE_TYPE)  # it has no such PDO, but is still there

    def _map(self, index: int, mapping: int, cob_id: int, objects: Sequence[Object]) -> None:
        """Write a mapping in the order CiA 301 asks for, and read it back."""
        identifier, kind = Object(index, 1, 32), Object(index, 2, 8)
        count = Object(mapping, 0, 8)
        entries = [
            (Object(mapping, sub, 32), one.index << 16 | one.sub << 8 | one.bits)
            for sub, one in enumerate(objects, start=1)
        ]
        self.put(identifier, cob_id | PDO_OFF)
        self.put(kind, ON_EVERY_SYNC)
        self.put(count, 0)
        for entry, value in entries:
            self.put(entry, value)
        self.put(count, len(objects))
        self.put(identifier, cob_id)
        for entry, value in (*entries, (count, len(objects)), (kind, ON_EVERY_SYNC)):
            if (found := self.get(entry)) != value:
                raise DeviceError(
                    f"{self.name}: node {self.node} did not take its PDO mapping: {entry} is "
                    f"0x{found:X}, not 0x{value:X}; it may have a fixed mapping"
                )

    def start(self, *, watch_master: bool) -> None:
        """Make it operational and have it show a heartbeat.

        `watch_master`: the device does its own safe thing when this computer falls silent.
        """
        settings = self.bus.settings
        beat_ms = round(settings.heartbeat * 1000)
        self.put(HEARTBEAT_TIME, beat_ms)
        if watch_master:
            self.put(MASTER_WATCHED, settings.own_node << 16 | MISSED_HEARTBEATS * beat_ms)
        self._go_operational("heartbeat")

    def start_guarded(self) -> None:
        """Make it operational and ask for its state again and again: it needs no heartbeat.

        The device watches the asking, by its life time (objects 100Ch, 100Dh).
        """
        period = self.bus.settings.heartbeat
        with suppress(DeviceError):  # it may have no heartbeat; a node has one or is guarded
            self.put(HEARTBEAT_TIME, 0)
        self.put(GUARD_TIME, round(period * 1000))
        self.put(LIFE_FACTOR, MISSED_HEARTBEATS)
        self.bus.expect_toggle(self.node)
        self._remote.nmt.start_node_guarding(period)
        self._go_operational("answer to node guarding")

    def _go_operational(self, sign: str) -> None:
        """Start it; DeviceError if the sign of life that is awaited does not come.

        The first may be of the state before.
        """
        self._remote.nmt.state = OPERATIONAL
        longest = self.bus.settings.heartbeat * MISSED_HEARTBEATS
        until = time.monotonic() + max(1.0, longest)
        while self.bus.silent_for(self.node) > longest or self._remote.nmt.state != OPERATIONAL:
            if time.monotonic() > until:
                raise DeviceError(f"{self.name}: node {self.node} shows no {sign}")
            time.sleep(0.01)

    def refuse_trouble(self) -> None:
        """Raise DeviceError for an emergency, a lost heartbeat or a restart of the device."""
        if self._emergency is not None:
            raise DeviceError(
                f"{self.name}: node {self.node} reports an emergency: {words_for(self._emergency)}"
            )
        silent = self.bus.silent_for(self.node)
        if silent > MISSED_HEARTBEATS * self.bus.settings.heartbeat:
            raise DeviceError(
                f"{self.name}: node {self.node} has shown no sign of life for {silent:.2g} s; "
                f"{self.bus.why_silent(time.monotonic() - silent, {self.node})}"
            )
        state = self._remote.nmt.state
        if state != OPERATIONAL:
            raise DeviceError(
                f"{self.name}: node {self.node} fell back to {state.lower()}; did it restart?"
            )

    def release(self, *, disarm: bool = True) -> None:
        """Leave the device; never raises.

        `disarm`: have it watch nobody any more. Else it notices that this computer is gone.
        """
        if self._remote is None or self.bus.network is None:
            return
        for watching in (LIFE_FACTOR, MASTER_WATCHED) if disarm else ():
            with suppress(DeviceError):  # it is gone, or does not have the object
                self.put(watching, 0)
        self._remote.nmt.stop_node_guarding()
        self.bus.network.nodes.pop(self.node, None)
        self._remote = None

    def _on_emergency(self, emergency: Any) -> None:
        """Keep the newest emergency, until it is reset."""
        self._emergency = emergency.code if emergency.code & 0xFF00 else None

    def _load(self, eds: str) -> None:
        """Write the values of a device configuration file; refuse one of another device."""
        for wanted, word in ((VENDOR, "vendor"), (PRODUCT, "product")):
            entry = self._remote.object_dictionary.get_variable(wanted.index, wanted.sub)
            due = None if entry is None else entry.value or entry.default
            found = self.get(wanted)
            if due and found != due:
                raise DeviceError(
                    f"{self.name}: {eds} is for {word} 0x{due:X}, but node {self.node} has "
                    f"{word} 0x{found:X}"
                )
        self._remote.load_configuration()
