"""The link `modbus`: a Modbus connection over TCP or a serial line (RTU), shared by its units."""

import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from threading import RLock
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Time
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError, LabdriveError

log = logging.getLogger(__name__)

# Modbus Application Protocol V1.1b3, section 7.
EXCEPTIONS = {
    1: "illegal function: it does not know this function code",
    2: "illegal data address: it has no such register",
    3: "illegal data value",
    4: "a failure of the device",
    5: "acknowledged, still working on it",
    6: "busy",
    8: "a parity error of its memory",
    10: "gateway path unavailable",
    11: "gateway: the device behind it does not answer",
}


class _NoAnswerError(DeviceError):
    """An answer is damaged or missing, or nobody can be reached: it may be asked for again."""


class ModbusBus:
    """One transaction at a time. What is not a sound answer is an error, never data."""

    class Settings(SettingsBase):
        """Where the bus is: `host` for TCP, `device` for RTU on a serial line."""

        host: str | None = Field(default=None, description="Name or address, for Modbus TCP.")
        port: int = Field(default=502, ge=1, le=65535)
        device: str | None = Field(
            default=None, description="Serial port, for Modbus RTU: /dev/ttyUSB0, COM3."
        )
        baud_rate: int = Field(default=115200, ge=1200, le=4_000_000)
        parity: Literal["none", "even", "odd"] = "even"
        stop_bits: Literal[1, 2] = 1
        timeout: Time = Field(default=0.5, gt=0, le=60, description="How long an answer may take.")
        retries: int = Field(
            default=1, ge=0, le=10, description="Asked again after a damaged or missing answer."
        )

        @model_validator(mode="after")
        def _one_of_two(self) -> Self:
            if (self.host is None) == (self.device is None):
                raise ValueError("give either host (TCP) or device (RTU)")
            return self

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self.settings = settings
        self.name = context.name
        self._client: Any = None
        self._lock = RLock()
        self._received = b""
        self._unanswered = False

    @property
    def place(self) -> str:
        """Where the bus is, for messages."""
        settings = self.settings
        return settings.device or f"{settings.host}:{settings.port}"

    def connect(self) -> None:
        """Open the connection; DeviceError if nobody is there."""
        # What goes wrong below is told here, in words, and not twice.
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
        client = self._made()
        self._open(client)
        self._client, self._unanswered = client, False

    def close(self) -> None:
        """Close it, open or not."""
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(OSError):
                client.close()

    def read(self, unit: int, function: int, address: int, count: int) -> list[int]:
        """Return registers, by function 3 (holding) or 4 (input)."""
        name = {3: "read_holding_registers", 4: "read_input_registers"}[function]
        what = f"register 0x{address:04X}"
        answer = self._ask(
            unit, what, lambda client: getattr(client, name)(address, count=count, device_id=unit)
        )
        if len(answer.registers) != count:
            raise DeviceError(
                f"{self.name}: unit {unit} answered {len(answer.registers)} registers at {what}, "
                f"where {count} were asked for"
            )
        return list(answer.registers)

    def write(self, unit: int, address: int, values: Sequence[int], *, single: bool) -> None:
        """Write registers, by function 6 (`single`) or 16."""
        what = f"register 0x{address:04X}"

        def send(client: Any) -> Any:
            if single:
                return client.write_register(address, values[0], device_id=unit)
            return client.write_registers(address, list(values), device_id=unit)

        self._ask(unit, what, send)

    def execute(self, unit: int, what: str, request: Any, response: type[Any]) -> Any:
        """Send a request of another function, and return its answer, which is a `response`."""

        def send(client: Any) -> Any:
            client.register(response)
            return client.execute(no_response_expected=False, request=request)

        return self._ask(unit, what, send)

    def _ask(self, unit: int, what: str, send: Callable[[Any], Any]) -> Any:
        """Return a sound answer, asking again where one was damaged or missing."""
        with self._lock:
            for left in range(self.settings.retries, -1, -1):
                try:
                    answer = self._answer(unit, what, send)
                except _NoAnswerError as error:
                    if not left:
                        raise
                    log.warning("asked again: %s", error)
                    continue
                if answer.isError():
                    raise self._refused(unit, what, answer.exception_code)
                return answer
        raise AssertionError  # the last try returned or raised

    def _answer(self, unit: int, what: str, send: Callable[[Any], Any]) -> Any:
        client = self._client
        if client is None:
            raise DeviceError(f"{self.name}: not connected")
        self._received = b""
        try:
            self._get_ready(client)
            self._unanswered = True
            answer = send(client)
        except _NoAnswerError as error:
            raise _NoAnswerError(f"unit {unit} does not answer: {error}") from error
        except LabdriveError:
            # Somebody's wish to stop the run arrives here too, from the signal's handler.
            raise
        except Exception as error:
            raise self._no_answer(unit, what) from error
        self._unanswered = False
        return answer

    def _refused(self, unit: int, what: str, code: int) -> DeviceError:
        word = EXCEPTIONS.get(code, "an exception that Modbus does not define")
        return DeviceError(f"{self.name}: unit {unit} refuses {what}: {word} (exception {code})")

    def _no_answer(self, unit: int, what: str) -> _NoAnswerError:
        """Return the error that tells silence, damage, and another unit's answer apart."""
        received = self._received
        if not received:
            why = "it does not answer; is it switched on, and is the unit number right?"
        elif (other := self._sender(received)) not in {None, unit}:
            why = f"unit {other} answers in its place; do two units share the bus?"
        else:
            why = f"its answer is damaged or out of turn ({received[:16].hex(' ')})"
        return _NoAnswerError(f"{self.name}: unit {unit} at {self.place}, {what}: {why}")

    def _sender(self, received: bytes) -> int | None:
        """Return which unit sent a sound frame; None if it is none."""
        if self.settings.host is not None:
            return received[6] if len(received) >= 8 and received[2:4] == b"\0\0" else None
        from pymodbus.framer.rtu import FramerRTU

        if len(received) < 4:
            return None
        sound = FramerRTU.check_CRC(received[:-2], int.from_bytes(received[-2:], "big"))
        return received[0] if sound else None

    def _get_ready(self, client: Any) -> None:
        """Open what was lost, and let a late answer pass: it is none to the next question."""
        over_tcp = self.settings.host is not None
        if self._unanswered and over_tcp:
            client.close()
        if not client.connected:
            self._open(client)
        if self._unanswered and not over_tcp:
            self._await_silence(client)

    def _await_silence(self, client: Any) -> None:
        """Listen until nothing has come for as long as an answer may take."""
        until = time.monotonic() + self.settings.timeout
        while time.monotonic() < until:
            if client.recv(None):
                until = time.monotonic() + self.settings.timeout
            time.sleep(0.005)

    def _open(self, client: Any) -> None:
        """Open the connection, for the first time or again; DeviceError if that cannot be."""
        try:
            if self.settings.host is None:
                _open_port(client)
            else:
                client.connect()
        except LabdriveError:
            raise
        except Exception as error:  # pyserial has termios.error and ValueError beside OSError
            raise self._unreachable(f" ({error})") from error
        if not client.connected:
            raise self._unreachable()

    def _unreachable(self, why: str = "") -> _NoAnswerError:
        return _NoAnswerError(
            f"{self.name}: {self.place} cannot be reached{why}; is it switched on, and is "
            f"{'the port free' if self.settings.device else 'the address right'}?"
        )

    def _made(self) -> Any:
        from pymodbus import FramerType
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient

        settings = self.settings
        shared: dict[str, Any] = {
            "timeout": settings.timeout,
            "retries": 0,
            "trace_packet": self._note,
        }
        if settings.host is not None:
            return ModbusTcpClient(settings.host, port=settings.port, **shared)
        return ModbusSerialClient(
            settings.device or "",
            framer=FramerType.RTU,
            baudrate=settings.baud_rate,
            parity=settings.parity[0].upper(),
            stopbits=settings.stop_bits,
            **shared,
        )

    def _note(self, sending: bool, data: bytes) -> bytes:
        """Keep what was received last, for the error message."""
        if not sending:
            self._received = bytes(data)
        return data


def _open_port(client: Any) -> None:
    """Open the client's serial port: by `client.connect` a signal's exception would be lost."""
    import serial  # type: ignore[import-untyped]

    given = client.comm_params
    client.socket = serial.serial_for_url(
        given.host,
        timeout=given.timeout_connect,
        write_timeout=given.timeout_connect,
        bytesize=given.bytesize,
        stopbits=given.stopbits,
        baudrate=given.baudrate,
        parity=given.parity,
        exclusive=True,
    )
    client.socket.inter_byte_timeout = client.inter_byte_timeout
