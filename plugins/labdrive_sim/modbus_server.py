"""A Modbus server of our own, so that client and server share no code: TCP, and RTU on a terminal.

Functions 3, 4, 6, 16 and 23, and 43 for what a device adds (Modbus Application Protocol V1.1b3).
What goes wrong on demand is here too.
"""

import contextlib
import os
import pty
import select
import socket
import struct
import time
import tty
from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import Protocol

from labdrive_sim.wire_faults import Faults

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, DEVICE_FAILURE = 1, 2, 4
MOST_REGISTERS = 125


class UnknownFunctionError(Exception):
    """A function code that the device does not have."""


class Registers(Protocol):
    """What is behind the registers of a unit."""

    def read(self, address: int) -> int:
        """Return a register; KeyError if there is none."""

    def write(self, address: int, values: Sequence[int]) -> None:
        """Take registers; KeyError if one of them cannot be written."""

    def encapsulated(self, data: bytes) -> bytes:
        """Answer function 43; UnknownFunctionError if the device does not have it."""


class Server:
    """Answers for one unit."""

    def __init__(self, unit: int, registers: Registers) -> None:
        self.unit = unit
        self.faults = Faults()
        self.last_asked = time.monotonic()
        self._registers = registers
        self._stopped = Event()

    def serve_tcp(self, host: str, port: int) -> int:
        """Serve in threads of its own; return the port."""
        listening = socket.create_server((host, port))
        Thread(target=self._accept, args=(listening,), daemon=True).start()
        return int(listening.getsockname()[1])

    def serve_terminal(self) -> str:
        """Serve RTU on a new pseudo-terminal; return the name of the end that clients open."""
        ours, theirs = pty.openpty()
        tty.setraw(ours)
        tty.setraw(theirs)
        Thread(target=self._serve_rtu, args=(ours,), daemon=True).start()
        return os.ttyname(theirs)

    def close(self) -> None:
        """Answer nobody any more."""
        self._stopped.set()

    def _accept(self, listening: socket.socket) -> None:
        listening.settimeout(0.2)
        while not self._stopped.is_set():
            with contextlib.suppress(TimeoutError):
                connection, _ = listening.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                Thread(target=self._serve_tcp, args=(connection,), daemon=True).start()
        listening.close()

    def _serve_tcp(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection:
            received = b""
            while chunk := connection.recv(4096):
                received += chunk
                while len(received) >= 6 and len(received) >= (end := 6 + _length(received)):
                    self._answer_tcp(connection.sendall, received[:end])
                    received = received[end:]

    def _answer_tcp(self, send: Callable[[bytes], object], frame: bytes) -> None:
        answer = self._answer(frame[6], frame[7:])
        if answer is not None:
            unit = frame[6] if self.faults.as_node is None else self.faults.as_node
            data = bytes([unit]) + answer
            self._send(send, frame[:4] + struct.pack(">H", len(data)) + data)

    def _serve_rtu(self, terminal: int) -> None:
        received = b""
        while not self._stopped.is_set():
            ready, _, _ = select.select([terminal], [], [], 0.05)
            if not ready:
                received = b""  # a pause ends a frame, sound or not
                continue
            with contextlib.suppress(OSError):
                received += os.read(terminal, 4096)
            size = _rtu_size(received)
            if size and len(received) >= size:
                self._answer_rtu(lambda data: os.write(terminal, data), received[:size])
                received = received[size:]

    def _answer_rtu(self, send: Callable[[bytes], object], frame: bytes) -> None:
        if crc(frame[:-2]) != frame[-2:]:
            return
        answer = self._answer(frame[0], frame[1:-2])
        if answer is not None:
            unit = frame[0] if self.faults.as_node is None else self.faults.as_node
            data = bytes([unit]) + answer
            self._send(send, data + crc(data))

    def _send(self, send: Callable[[bytes], object], frame: bytes) -> None:
        if self.faults.delay_s:
            time.sleep(self.faults.delay_s)
        if self.faults.garble:
            frame = frame[:-3] + bytes(byte ^ 0xA5 for byte in frame[-3:-1])
        send(frame)

    def _answer(self, unit: int, request: bytes) -> bytes | None:
        """Return what answers a request, function code first; None for silence."""
        self.last_asked = time.monotonic()
        if unit != self.unit or self.faults.silent:
            return None
        try:
            return bytes([request[0]]) + self._carried_out(request[0], request[1:])
        except KeyError:
            code = ILLEGAL_ADDRESS
        except UnknownFunctionError:
            code = ILLEGAL_FUNCTION
        except (ValueError, struct.error):
            code = DEVICE_FAILURE
        return bytes([request[0] | 0x80, code])

    def _carried_out(self, function: int, data: bytes) -> bytes:
        if function in {3, 4}:
            return self._read(*struct.unpack(">HH", data[:4]))
        if function == 6:
            address, value = struct.unpack(">HH", data[:4])
            self._registers.write(address, [value])
            return data[:4]
        if function == 16:
            address, count = struct.unpack(">HH", data[:4])
            self._registers.write(address, _words(data[5 : 5 + 2 * count]))
            return data[:4]
        if function == 23:
            read, count, write, written = struct.unpack(">HHHH", data[:8])
            self._registers.write(write, _words(data[9 : 9 + 2 * written]))
            return self._read(read, count)
        if function == 43:
            return self._registers.encapsulated(data)
        raise UnknownFunctionError

    def _read(self, address: int, count: int) -> bytes:
        if not 1 <= count <= MOST_REGISTERS:
            raise ValueError(count)
        words = [self._registers.read(address + i) for i in range(count)]
        return bytes([2 * count]) + struct.pack(f">{count}H", *words)


def crc(data: bytes) -> bytes:
    """Return the CRC-16 of RTU frames, as sent (Modbus over Serial Line V1.02, 2.5.1.2)."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def _length(frame: bytes) -> int:
    return int.from_bytes(frame[4:6], "big")


def _words(data: bytes) -> list[int]:
    return list(struct.unpack(f">{len(data) // 2}H", data))


def _rtu_size(frame: bytes) -> int:
    """Return how long a request is that begins so; 0 if that cannot be told yet."""
    if len(frame) < 2:
        return 0
    if frame[1] == 16:
        return 9 + frame[6] if len(frame) > 6 else 0
    if frame[1] == 23:
        return 13 + frame[10] if len(frame) > 10 else 0
    return 15 if frame[1] == 43 else 8
