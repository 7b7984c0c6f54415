"""The emulated drives on Modbus: the registers of several makes before the same axis."""

import argparse
import struct
import time
from collections import deque
from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import Any

import numpy as np

from labdrive_sim.drive_axis import (
    ENABLED,
    FAULT,
    HOMING,
    PROFILE_POSITION,
    STOPPING,
    Axis,
)
from labdrive_sim.modbus_server import Server, UnknownFunctionError

TICK_S = 0.002
ENERGIZED = frozenset({ENABLED, STOPPING})
FAULT_COMMUNICATION = 0x7500
CARRIAGE = 0x7000
NANOMETRE = 1e-9

Getter = Callable[[], int]
Setter = Callable[[int], None]


class Image:
    """Registers by address; values of two registers have the high word first."""

    def __init__(self) -> None:
        self._words: dict[int, Getter] = {}
        self._setters: dict[int, tuple[int, Setter]] = {}

    def word(self, address: int, get: Getter, put: Setter | None = None) -> None:
        """Add a value of one register."""
        self._words[address] = lambda: get() & 0xFFFF
        if put is not None:
            self._setters[address] = (1, put)

    def long(self, address: int, get: Getter, put: Setter | None = None) -> None:
        """Add a signed value of two registers."""
        self._words[address] = lambda: get() >> 16 & 0xFFFF
        self._words[address + 1] = lambda: get() & 0xFFFF
        if put is not None:
            self._setters[address] = (2, put)

    def read(self, address: int) -> int:
        """Return a register."""
        return self._words[address]()

    def write(self, address: int, values: Sequence[int]) -> None:
        """Take registers."""
        at = 0
        while at < len(values):
            width, put = self._setters[address + at]
            raw = b"".join(value.to_bytes(2, "big") for value in values[at : at + width])
            if len(raw) < 2 * width:
                raise KeyError(address + at)
            put(int.from_bytes(raw, "big", signed=width == 2))
            at += width

    def encapsulated(self, _data: bytes) -> bytes:
        """Know nothing of function 43."""
        raise UnknownFunctionError


class Late:
    """A register as it was a while ago, as a drive shows it that refreshes it now and then."""

    def __init__(self, get: Getter, lag_s: float) -> None:
        self._get, self._lag_s = get, lag_s
        self._past = deque([(time.monotonic(), get())])

    def __call__(self) -> int:
        """Return the register, as late as it was last noted."""
        return self._past[0][1] if self._lag_s else self._get()

    def note(self, now: float) -> None:
        """Take note of what it is now; forget what is older than need be."""
        self._past.append((now, self._get()))
        while len(self._past) > 1 and self._past[1][0] <= now - self._lag_s:
            self._past.popleft()


class ModbusDevice:
    """An axis with registers before it, and an encoder on its carriage; a clock moves it."""

    def __init__(self, axis: Axis, options: argparse.Namespace) -> None:
        self.axis = axis
        self._speed = options.speed
        self._step: float = options.resolution
        self._noise: float = options.noise
        self._random = np.random.default_rng(options.seed)
        self.watchdog_ms = 0
        self._status_lag_s: float = options.status_lag
        self._late: list[Late] = []
        image = MAPS[options.map](axis, self)
        image.long(CARRIAGE, self._carriage)
        self.server = Server(options.unit, _Present(image, self))
        self._lived_until = time.monotonic()
        self._stopped = Event()
        self._clock = Thread(target=self._run, daemon=True)
        axis.plant.connect()
        self._clock.start()

    def close(self) -> None:
        """Stop living."""
        self._stopped.set()
        self._clock.join()
        self.server.close()

    def late(self, get: Getter) -> Late:
        """Return a register of the drive's status, which is shown with a lag."""
        self._late.append(Late(get, self._status_lag_s))
        return self._late[-1]

    def _carriage(self) -> int:
        position = float(self.axis.plant.stretch.position[-1])
        seen = position + self._noise * self._random.standard_normal()
        return round(round(seen / self._step) * self._step / NANOMETRE)

    def catch_up(self) -> None:
        """Let as much time pass for the axis as has passed; whoever calls this holds its lock."""
        now = time.monotonic()
        while (left := now - self._lived_until) > 0:
            step = min(left, TICK_S)
            for _ in range(self._speed):
                self.axis.advance(step)
            self._lived_until = now if step == left else self._lived_until + step
        for status in self._late:
            status.note(now)

    def _run(self) -> None:
        while not self._stopped.wait(TICK_S):
            with self.axis.lock:
                self.catch_up()
                self._watch(time.monotonic())

    def _watch(self, now: float) -> None:
        """Stop by itself when nobody has asked for so long."""
        silent = 1000 * (now - self.server.last_asked)
        if self.watchdog_ms and silent > self.watchdog_ms and self.axis.state == ENABLED:
            self.axis.fail(FAULT_COMMUNICATION)


class _Present:
    """Registers that are reached one request at a time, and are of the moment of the request.

    The clock's thread may be late on a busy machine; what is read must not be.
    """

    def __init__(self, image: Any, device: ModbusDevice) -> None:
        self._image, self._device, self._lock = image, device, device.axis.lock

    def read(self, address: int) -> int:
        with self._lock:
            self._device.catch_up()
            return int(self._image.read(address))

    def write(self, address: int, values: Sequence[int]) -> None:
        with self._lock:
            self._device.catch_up()
            self._image.write(address, values)

    def encapsulated(self, data: bytes) -> bytes:
        with self._lock:
            return bytes(self._image.encapsulated(data))


def _setter(axis: Axis, name: str) -> Setter:
    return lambda value: setattr(axis, name, value)


def cia402(axis: Axis, device: ModbusDevice) -> Image:
    """Return CiA 402 objects in registers of their own."""
    image = Image()
    image.word(0x1000, lambda: axis.controlword, axis.set_controlword)
    image.word(0x1001, device.late(lambda: axis.statusword))
    image.word(0x1002, lambda: axis.error_code)
    image.word(0x1003, lambda: axis.mode, axis.set_mode)
    image.word(0x1004, lambda: axis.mode)
    image.word(0x1005, lambda: axis.homing_method, _setter(axis, "homing_method"))
    image.word(0x1006, lambda: device.watchdog_ms, lambda v: setattr(device, "watchdog_ms", v))
    image.long(0x1010, lambda: axis.actual)
    image.long(0x1012, lambda: axis.target, _setter(axis, "target"))
    image.long(0x1014, lambda: axis.profile_velocity, _setter(axis, "profile_velocity"))
    image.long(0x1016, lambda: axis.profile_acceleration, _setter(axis, "profile_acceleration"))
    return image


class Nanotec(Image):
    """CiA 402 objects in two process images; the mapping is told by function 43."""

    TAKEN = (0x60400010, 0x60600008, 0x00050008, 0x607A0020, 0x60810020, 0x60830020)
    SENT = (0x60410010, 0x60610008, 0x00050008, 0x60640020, 0x603F0010)

    def __init__(self, axis: Axis, device: ModbusDevice) -> None:
        super().__init__()
        # An object of 8 bits and its dummy share a register: the object has its high byte.
        self.word(6000, lambda: axis.controlword, axis.set_controlword)
        self.word(6001, lambda: axis.mode << 8, lambda value: axis.set_mode(value >> 8))
        self.long(6002, lambda: axis.target, _setter(axis, "target"))
        self.long(6004, lambda: axis.profile_velocity, _setter(axis, "profile_velocity"))
        self.long(6006, lambda: axis.profile_acceleration, _setter(axis, "profile_acceleration"))
        self.word(5000, device.late(lambda: axis.statusword))
        self.word(5001, lambda: axis.mode << 8)
        self.long(5002, lambda: axis.actual)
        self.word(5004, lambda: axis.error_code)

    def encapsulated(self, data: bytes) -> bytes:
        """Tell an entry of the mapping."""
        _mei, _options, _reserved, _node, index, sub, _start, count = struct.unpack(
            ">BBBBHBHH", data[:11]
        )
        entries = {0x3502: self.TAKEN, 0x3602: self.SENT}[index]
        value = len(entries) if sub == 0 else dict(enumerate(entries, start=1))[sub]
        return data[:11] + value.to_bytes(count, "big")


class Leadshine(Image):
    """CS2RS: path 0 of the PR mode in a block at 6200h."""

    def __init__(self, axis: Axis, device: ModbusDevice) -> None:
        super().__init__()
        self._axis = axis
        self._path = [0] * 8
        axis.set_mode(PROFILE_POSITION)
        self.word(0x000F, lambda: int(axis.state in ENERGIZED), self._enable)
        self.word(0x1003, device.late(self._status))
        self.long(0x1014, lambda: axis.actual)
        self.word(0x1801, lambda: 0, self._auxiliary)
        self.word(0x2203, lambda: axis.error_code)
        self.word(0x6002, lambda: 0, self._control)
        for i in range(8):
            self.word(0x6200 + i, lambda i=i: self._path[i], self._taker(i))  # type: ignore[misc]

    def _taker(self, i: int) -> Setter:
        def take(value: int) -> None:
            self._path[i] = value
            if i == 7 and value == 0x10:
                self._run_path()

        return take

    def _enable(self, value: int) -> None:
        for word in (0x06, 0x07, 0x0F) if value else (0x00,):
            self._axis.set_controlword(word)

    def _status(self) -> int:
        axis = self._axis
        rest = bool(axis.statusword & 1 << 10)
        bits = (
            axis.state == FAULT,
            axis.state in ENERGIZED,
            not rest,
            False,
            rest,
            rest,
            axis.homed,
        )
        return sum(bit << i for i, bit in enumerate(bits))

    def _auxiliary(self, value: int) -> None:
        if value == 0x1111:
            self._axis.set_controlword(0x00)
            self._axis.set_controlword(0x80)

    def _control(self, value: int) -> None:
        if value == 0x40:
            self._axis.set_controlword(0x02)
        elif value in {0x20, 0x21}:
            self._axis.homing_method = 35 if value == 0x21 else 34
            self._axis.set_mode(HOMING)
            self._axis.set_controlword(0x0F)
            self._axis.set_controlword(0x1F)

    def _run_path(self) -> None:
        axis, (_mode, high, low, rpm, up_ms, *_) = self._axis, self._path
        axis.set_mode(PROFILE_POSITION)
        raw = (high << 16 | low).to_bytes(4, "big")
        axis.target = int.from_bytes(raw, "big", signed=True)
        per_turn = axis.settings.counts_per_turn
        axis.profile_velocity = max(1, rpm * per_turn // 60)
        axis.profile_acceleration = round(1000 / 60 * per_turn / (max(1, up_ms) / 1000))
        axis.set_controlword(0x0F)
        axis.set_controlword(0x1F)


class Iai(Image):
    """ROBO Cylinder: numerical value movement command; lengths in 0.01 mm."""

    SERVO_ON, ALARM_RESET, PAUSE, HOME = 1 << 12, 1 << 8, 1 << 5, 1 << 4

    def __init__(self, axis: Axis, device: ModbusDevice) -> None:
        super().__init__()
        self._axis = axis
        self._block = [0] * 9
        self._commanded = 0
        self._paused = self._remains = False
        axis.set_mode(PROFILE_POSITION)
        self.long(0x9000, self._position)
        self.word(0x9002, lambda: axis.error_code)
        self.word(0x9005, device.late(self._status))
        self.word(0x9006, lambda: 1 << 15)
        self.word(0x9007, device.late(self._expansion_status))
        self.word(0x0D00, lambda: 0, self._control)
        for i in range(9):
            self.word(0x9900 + i, lambda i=i: self._block[i], self._taker(i))  # type: ignore[misc]

    @property
    def _hundredths_per_turn(self) -> float:
        return self._axis.plant.lead / 1e-5

    def _position(self) -> int:
        turns = self._axis.actual / self._axis.settings.counts_per_turn
        return round(turns * self._hundredths_per_turn)

    def _taker(self, i: int) -> Setter:
        def take(value: int) -> None:
            self._block[i] = value
            if i == 8:
                self._move()

        return take

    def _status(self) -> int:
        axis = self._axis
        there = bool(axis.statusword & 1 << 10)
        on, failed = axis.state in ENERGIZED, axis.state == FAULT
        return 1 << 13 | on << 12 | failed << 10 | axis.homed << 4 | there << 3

    def _expansion_status(self) -> int:
        axis = self._axis
        moving = not axis.statusword & 1 << 10
        return (moving and axis.mode == HOMING) << 11 | moving << 5

    def _control(self, value: int) -> None:
        axis, rising = self._axis, value & ~self._commanded
        self._commanded = value
        if rising & self.ALARM_RESET:
            self._remains = False
            if axis.state == FAULT:
                axis.set_controlword(0x80)
                axis.set_controlword(0x00)
        if not value & self.SERVO_ON:
            axis.set_controlword(0x00)
        elif axis.state not in ENERGIZED:
            for word in (0x06, 0x07, 0x0F):
                axis.set_controlword(word)
        self._pause(bool(value & self.PAUSE))
        if rising & self.HOME:
            axis.homing_method = 34
            axis.set_mode(HOMING)
            axis.set_controlword(0x0F)
            axis.set_controlword(0x1F)

    def _pause(self, paused: bool) -> None:
        """Stop, or resume what remains of a move, as the manual says."""
        axis = self._axis
        if paused and not self._paused:
            self._remains = not axis.statusword & 1 << 10
            axis.set_controlword(0x02)
        elif self._paused and not paused:
            axis.set_controlword(0x0F)
            if self._remains:
                axis.set_controlword(0x1F)
        self._paused = paused

    def _move(self) -> None:
        if self._paused:
            return
        axis, per_turn = self._axis, self._hundredths_per_turn
        axis.set_mode(PROFILE_POSITION)
        raw = (self._block[0] << 16 | self._block[1]).to_bytes(4, "big")
        counts = axis.settings.counts_per_turn
        axis.target = round(int.from_bytes(raw, "big", signed=True) / per_turn * counts)
        speed = (self._block[4] << 16 | self._block[5]) / per_turn * counts
        axis.profile_velocity = max(1, round(speed))
        axis.profile_acceleration = max(
            1, round(self._block[6] / 100 * 9.80665 / self._axis.plant.lead * counts)
        )
        axis.set_controlword(0x0F)
        axis.set_controlword(0x1F)


MAPS: dict[str, Callable[[Axis, ModbusDevice], Image]] = {
    "cia402": cia402,
    "nanotec": Nanotec,
    "leadshine": Leadshine,
    "iai": Iai,
}
