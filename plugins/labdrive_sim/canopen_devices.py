"""The emulated CANopen devices: a CiA 402 servo drive and a CiA 406 linear encoder."""

import time
from threading import Event, Thread

import can
import numpy as np
from canopen import Network

from labdrive_sim.canopen_node import FaultyBus, Node
from labdrive_sim.canopen_objects import COMMUNICATION, DRIVE, ENCODER, dictionary, pdo_entries
from labdrive_sim.drive_axis import CYCLIC_POSITION, ENABLED, FAULT_SYNC, STOPPING, Axis

TICK_S = 0.002
SYNC_MISSED_S = 0.5
FAULT_HEARTBEAT = 0x8130
INCREMENTS = 16
PDOS = 4
LOOK_S = 0.05
# Objects that an axis has as they are.
SETTABLE = {
    0x605A: "quick_stop_option",
    0x6065: "following_window",
    0x6066: "following_timeout_ms",
    0x607A: "target",
    0x6081: "profile_velocity",
    0x6083: "profile_acceleration",
    0x6098: "homing_method",
}


class CanopenDrive:
    """A CiA 402 drive. Between SYNCs, or without any, a clock of its own moves it."""

    def __init__(self, axis: Axis, node_id: int) -> None:
        self.axis = axis
        self.node = Node(
            node_id,
            dictionary(COMMUNICATION, DRIVE, pdo_entries(PDOS)),
            self._read,
            self._write,
        )
        self.node.on_sync = self._on_sync
        self.node.on_lost_master = self._on_lost_master
        self._last_sync = 0.0
        self._reported = 0
        self._stopped = Event()
        self._clock = Thread(target=self._run, daemon=True)

    def start(self, network: Network) -> None:
        """Join a network and begin to live."""
        self.axis.plant.connect()
        self.node.join(network)
        self._clock.start()

    def stop(self) -> None:
        """Stop living."""
        self._stopped.set()
        self._clock.join()
        self.node.leave()

    def _read(self, index: int, sub: int) -> int | None:
        axis = self.axis
        with axis.lock:
            # Increments of the encoder are not what positions are counted in.
            if index == 0x608F and sub == 1:
                return INCREMENTS * axis.settings.counts_per_turn
            if index == 0x6092 and sub == 1:
                return axis.settings.counts_per_turn
            values = {
                0x1001: 1 if axis.error_code else 0,
                0x603F: axis.error_code,
                0x6041: axis.statusword,
                0x6061: axis.mode,
                0x6062: axis.demand,
                0x6064: axis.actual,
                0x60F4: axis.following_error,
            }
            return values.get(index)

    def _write(self, index: int, sub: int, value: int) -> None:
        with self.axis.lock:
            self._wrote(index, sub, value)

    def _wrote(self, index: int, sub: int, value: int) -> None:
        axis = self.axis
        if index == 0x6040:
            axis.set_controlword(value)
        elif index == 0x6060:
            axis.set_mode(value)
        elif index == 0x607D and sub:
            low, high = axis.limits or (0, 0)
            axis.limits = (value, high) if sub == 1 else (low, value)
        elif index in SETTABLE:
            setattr(axis, SETTABLE[index], value)

    @property
    def _period_s(self) -> float:
        exponent = self.node.value(0x60C2, 2)
        return float(self.node.value(0x60C2, 1)) * 10.0 ** (exponent - 256 * (exponent > 127))

    def _on_sync(self) -> None:
        """Go on by a period of the SYNC: its own clock is taken to follow the SYNC's."""
        with self.axis.lock:
            self._last_sync = time.monotonic()
            self.axis.follow_set_point(self._period_s)
        self._report()

    def _on_lost_master(self) -> None:
        """Do as object 6007h says when the master is gone: 3 is a quick stop."""
        with self.axis.lock:
            if self.axis.state == ENABLED:
                self.axis.state = STOPPING
        self.node.emergency(FAULT_HEARTBEAT)

    def _run(self) -> None:
        before = time.monotonic()
        while not self._stopped.wait(TICK_S):
            now = time.monotonic()
            self.node.check_master()
            with self.axis.lock:
                self._tick(now, now - before)
            self._report()
            before = now

    def _tick(self, now: float, seconds: float) -> None:
        axis, cyclic = self.axis, self.axis.mode == CYCLIC_POSITION
        if cyclic and axis.state == ENABLED:
            if self._last_sync and now - self._last_sync > SYNC_MISSED_S:
                axis.fail(FAULT_SYNC)
            return
        self._last_sync = 0.0
        axis.advance(seconds)

    def _report(self) -> None:
        """Send an EMCY for each new fault, and one when it is gone."""
        if self.axis.error_code != self._reported:
            self._reported = self.axis.error_code
            self.node.emergency(self._reported)


class CanopenEncoder:
    """A CiA 406 linear encoder on the carriage of the same spindle."""

    def __init__(self, axis: Axis, node_id: int, step_m: float, noise_m: float, seed: int) -> None:
        self._axis = axis
        self._step, self._noise = step_m, noise_m
        self._random = np.random.default_rng(seed)
        objects = dictionary(COMMUNICATION, ENCODER, pdo_entries(PDOS))
        self.node = Node(node_id, objects, self._read, lambda *_: None)

    def _read(self, index: int, _sub: int) -> int | None:
        if index == 0x6501:
            return round(self._step / 1e-9)
        if index != 0x6004:
            return None
        with self._axis.lock:
            position = float(self._axis.plant.stretch.position[-1])
        return round((position + self._noise * self._random.standard_normal()) / self._step)


class CanopenDevices:
    """A drive and an encoder on one bus. The encoder is told of a SYNC before the drive goes on.

    `bus` carries their faults.
    """

    def __init__(self, drive: CanopenDrive, encoder: CanopenEncoder, bus: can.BusABC) -> None:
        self.bus = FaultyBus(bus)
        self._drive, self.encoder = drive, encoder
        self._network = Network(self.bus)  # type: ignore[arg-type]  # a bus in all that is used
        self._network.NOTIFIER_CYCLE = LOOK_S
        self._network.connect()
        encoder.node.join(self._network)
        drive.start(self._network)

    def close(self) -> None:
        """Leave the bus."""
        self._drive.stop()
        self.encoder.node.leave()
        self._network.disconnect()
