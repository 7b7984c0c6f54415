"""A socketcand server: processes share a CAN bus over TCP where the kernel has none.

The protocol is that of https://github.com/linux-can/socketcand (its doc/protocol.md) in raw mode.
"""

import contextlib
import re
import socket
from collections.abc import Callable, Iterator
from threading import Thread

import can

_COMMAND = re.compile(rb"<\s*([^<>]*?)\s*>")
_TRICKLE_S = 1.0


class Hub:
    """Serves one channel to any number of clients; each has a bus of its own on it."""

    def __init__(self, open_bus: Callable[[], can.BusABC], host: str, port: int) -> None:
        """Listen at once; `port` 0 takes a free one."""
        self._open_bus = open_bus
        self._socket = socket.create_server((host, port))
        self._clients: list[_Client] = []
        Thread(target=self._accept, daemon=True).start()

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def close(self) -> None:
        """Hang up on every client."""
        self._socket.close()
        for client in self._clients:
            client.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                client = _Client(connection, self._open_bus())
                self._clients.append(client)
                client.start()


class _Client:
    """One connection: what it sends goes to the bus, what the bus carries goes to it."""

    def __init__(self, connection: socket.socket, bus: can.BusABC) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection, self._bus = connection, bus
        self._open = True

    def start(self) -> None:
        """Greet, then serve from two threads."""
        self._connection.sendall(b"< hi >")
        Thread(target=self._from_client, daemon=True).start()

    def close(self) -> None:
        """Hang up."""
        self._open = False
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()

    def _from_client(self) -> None:
        with contextlib.suppress(OSError):
            for command in self._commands():
                self._obey(command)
        self.close()

    def _commands(self) -> Iterator[list[bytes]]:
        received = b""
        while chunk := self._connection.recv(4096):
            received += chunk
            end = 0
            for found in _COMMAND.finditer(received):
                end = found.end()
                yield found.group(1).split()
            received = received[end:]

    def _obey(self, command: list[bytes]) -> None:
        match command:
            case [b"send", can_id, _, *data]:
                self._bus.send(_message(can_id, data))
            case [b"open", _]:
                self._connection.sendall(b"< ok >")
            case [b"rawmode"]:
                self._connection.sendall(b"< ok >")
                Thread(target=self._to_client, daemon=True).start()
            case _:
                self._connection.sendall(b"< error unknown command >")

    def _to_client(self) -> None:
        with contextlib.suppress(OSError):
            while self._open:
                message = self._bus.recv(_TRICKLE_S)
                if message is not None:
                    self._connection.sendall(_text(message))
        self._bus.shutdown()


def _message(can_id: bytes, data: list[bytes]) -> can.Message:
    return can.Message(
        arbitration_id=int(can_id, 16),
        is_extended_id=len(can_id) > 3,
        data=[int(byte, 16) for byte in data],
    )


def _text(message: can.Message) -> bytes:
    width = 8 if message.is_extended_id else 3
    data = message.data.hex().upper()
    return f"< frame {message.arbitration_id:0{width}X} {message.timestamp:.6f} {data} >".encode()
