"""Nanotec drives on Modbus: CiA 402 objects in an image whose mapping the drive tells.

Objects are read by function 2Bh, MEI type 0Dh (CANopen general reference; Modbus Application
Protocol V1.1b3, 6.20): options, reserved, node, index, sub-index, start, count, data.
"""

import struct
from typing import Any, Literal

from labdrive.model.errors import DeviceError
from labdrive_spindle.canopen_objects import DRIVE
from labdrive_spindle.modbus_bus import ModbusBus
from labdrive_spindle.register_maps import CIA402_NEEDS, NANOTEC_SENT, NANOTEC_TAKEN
from labdrive_spindle.registers import Register

TAKEN_MAPPING = 0x3502
SENT_MAPPING = 0x3602
CAN_ENCAPSULATION = 0x0D
MOST_ENTRIES = 16
_HEADER = struct.Struct(">BBBBHBHH")

_NAMES = {(one.index, one.sub): name for name, one in DRIVE.items()}
Words = Literal["big", "little"]

_SENT = frozenset({"statusword", "error_code", "mode_display", "position"})


def read_map(bus: ModbusBus, unit: int, words: Words) -> dict[str, Register]:
    """Return where the drive's own mapping has each object; DeviceError if one is not mapped."""
    found = {
        **_image(bus, unit, TAKEN_MAPPING, words),
        **_image(bus, unit, SENT_MAPPING, words),
    }
    missing = [name for name in CIA402_NEEDS if name not in found]
    if missing:
        wanted = ", ".join(
            f"{DRIVE[name]} in {SENT_MAPPING if name in _SENT else TAKEN_MAPPING:04X}h"
            for name in missing
        )
        raise DeviceError(
            f"{bus.name}: unit {unit} does not have all objects in its process image; map {wanted} "
            "with the maker's software, and save"
        )
    return found


def _image(bus: ModbusBus, unit: int, mapping: int, words: Words) -> dict[str, Register]:
    """Return the registers of one image, from its mapping.

    Data follow without gaps; an object that does not begin a register cannot be reached.
    """
    registers, bytes_before = {}, 0
    start = NANOTEC_TAKEN if mapping == TAKEN_MAPPING else NANOTEC_SENT
    entries = _read(bus, unit, mapping, 0, 1)
    if entries > MOST_ENTRIES:
        raise DeviceError(f"{bus.name}: unit {unit} claims {entries} entries in {mapping:04X}h")
    for sub in range(1, entries + 1):
        entry = _read(bus, unit, mapping, sub, 4)
        index, object_sub, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
        name = _NAMES.get((index, object_sub))
        if name is not None and bytes_before % 2 == 0:
            registers[name] = _register(name, start + bytes_before // 2, bits, words)
        bytes_before += bits // 8
    return registers


def _register(name: str, address: int, bits: int, words: Words) -> Register:
    signed = "int" if DRIVE[name].signed else "uint"
    if bits == 8:
        # It has the high byte of its register, and what follows, a dummy, the low one.
        return Register(address=address, scale=1 / 256)
    width = 32 if bits == 32 else 16
    return Register.model_validate({"address": address, "type": f"{signed}{width}", "words": words})


def _read(bus: ModbusBus, unit: int, index: int, sub: int, size: int) -> int:
    """Return an object of the drive, by CAN encapsulation."""
    request, response = _pdus(index, sub, size, unit)
    answer = bus.execute(unit, f"object {index:04X}h:{sub}", request, response)
    if (answer.index, answer.sub) != (index, sub) or len(answer.data) != size:
        raise DeviceError(f"{bus.name}: unit {unit} answered for another object than asked")
    return int.from_bytes(answer.data, "big")


def _pdus(index: int, sub: int, size: int, unit: int) -> tuple[Any, type[Any]]:
    """Return a request and the class of its response, as pymodbus wants them."""
    from pymodbus.pdu import ModbusPDU

    class Response(ModbusPDU):
        function_code = 0x2B
        sub_function_code = CAN_ENCAPSULATION
        index = sub = 0
        data = b""

        @classmethod
        def calculateRtuFrameSize(cls, data: bytes) -> int:  # noqa: N802 pymodbus calls it so
            return 0 if len(data) < 13 else 13 + data[12] + 2

        def decode(self, data: bytes) -> None:
            _mei, _options, _reserved, _node, self.index, self.sub, _start, count = (
                _HEADER.unpack_from(data)
            )
            self.data = data[_HEADER.size : _HEADER.size + count]

    class Request(Response):
        def encode(self) -> bytes:
            return _HEADER.pack(CAN_ENCAPSULATION, 0, 0, 0, index, sub, 0, size)

    return Request(dev_id=unit), Response
