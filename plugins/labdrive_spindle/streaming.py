"""Stream set-points on the SYNC's grid from a thread of its own, so that no chunk delays them."""

import math
import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Queue
from threading import Event, Thread
from typing import Protocol

import numpy as np

from labdrive.interfaces.devices import Samples
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN

CHUNK_S = 0.05
# The interpreter's own is 5 ms, longer than a cycle of the SYNC.
SWITCH_INTERVAL_S = 2e-4
# A drive answers the first SYNC before it can have taken a set-point, and some lock to it first.
TAKE_UP_CYCLES = 10

Answers = Mapping[int, bytes]
Chunk = tuple[Samples, list[Answers]]


class Follower(Protocol):
    """A drive that is streamed to. Each method is called from the stream's thread."""

    def exchange(self, phase: float) -> Answers:
        """Send a phase [rad] with the SYNC; return what was answered. DeviceError for a fault."""

    def reached(self, answers: Answers) -> float:
        """Return the phase [rad] that answers show; DeviceError if the drive does not follow."""

    def leave(self) -> None:
        """Have the drive do without the SYNC, which goes on until this returns."""


@dataclass(frozen=True)
class Grid:
    """A motion on the grid of the SYNC: `stride` cycles of it a sample, `ramp` to get up to speed.

    Numbers count cycles of the SYNC; 0 is the first recorded sample. From standstill where the
    settling cycles begin, the motion backs off, runs up, settles, is recorded, and runs out.
    """

    motion: Motion
    stride: int
    ramp: int
    period_s: float

    @property
    def per_period(self) -> int:
        """Cycles of the SYNC in one of the actuator's."""
        return self.motion.samples_per_period * self.stride

    @property
    def step(self) -> float:
        """What the phase gains in a cycle of the SYNC at full rate, signed [rad]."""
        return self.motion.direction.sign * TURN / self.per_period

    @property
    def first(self) -> int:
        """The first, at standstill."""
        return self.farthest_back - 2 * self.ramp  # as gently as the run-up, and no faster

    @property
    def farthest_back(self) -> int:
        """Where backing off ends and the run-up begins, at standstill."""
        return self.settled_from - self.ramp

    @property
    def settled_from(self) -> int:
        """The first at full rate."""
        return -self.motion.settle_periods * self.per_period

    @property
    def last(self) -> int:
        """The last recorded, and at full rate."""
        return self.motion.periods * self.per_period

    @property
    def end(self) -> int:
        """The first at standstill again."""
        return self.last + self.ramp

    def phase(self, number: int) -> float:
        """Return the phase [rad] at a cycle of the SYNC."""
        settled, ramp = self.settled_from, self.ramp
        if number < self.farthest_back:
            share = (number - self.first) / (self.farthest_back - self.first)
            return self.step * (settled - ramp / 2 * _eased(share))
        # What is lost on full rate before it is reached, and after it is left.
        before, after = max(0, settled - number), max(0, min(number, self.end) - self.last)
        lost = (before**2 - after**2) / (2 * ramp) if ramp else 0.0
        return self.step * (min(number, self.end) + lost)


@dataclass
class Timing:
    """How well the grid was kept. `late_s` is how late each SYNC went out."""

    late_s: list[float] = field(default_factory=list)
    lost: int = 0


@dataclass
class Lead:
    """By how much set-points run ahead so that the motor, which follows late, is in phase.

    What it lags is measured while the motion settles, over a whole cycle if there are two: a part
    of one would take the motor's cogging for a lag. It is made up for in what is left, little by
    little, and given back on the way to standstill, where there is no lag.
    """

    grid: Grid
    _lags: list[float] = field(default_factory=list)
    _correction: float = 0.0

    def at(self, number: int) -> float:
        """Return the lead [rad] at a cycle of the SYNC."""
        _, begin, end = self._cycles
        if number >= begin and self._lags:
            self._correction = math.fsum(self._lags) / len(self._lags)
            self._lags.clear()
        made_up = _eased((number - begin) / (end - begin))
        given_back = _eased((number - self.grid.last) / max(1, self.grid.ramp))
        return self._correction * (made_up - given_back)

    def learn(self, number: int, phase: float) -> None:
        """Take note of the phase [rad] that the motor had at a cycle of the SYNC."""
        measured_from, measured_until, _ = self._cycles
        if measured_from <= number < measured_until:
            self._lags.append(self.grid.phase(number) - phase)

    @property
    def _cycles(self) -> tuple[float, float, float]:
        """Where measuring begins and ends, and from where on the lead stays as it is."""
        several = self.grid.motion.settle_periods > 1
        before = (-1.5, -0.5, -0.2) if several else (-0.75, -0.35, -0.15)
        first, until, steady = (cycles * self.grid.per_period for cycles in before)
        return first, until, steady


class Stream:
    """Plays a grid on a drive."""

    def __init__(self, grid: Grid, follower: Follower) -> None:
        self.timing = Timing()
        self._grid = grid
        self._follower = follower
        self._lead = Lead(grid)
        self._sent = grid.phase(grid.first)
        self._step = 0.0
        self._chunks: Queue[Chunk | Exception | None] = Queue()
        self._halt = Event()
        self._thread = Thread(target=self._run, name="set-points", daemon=True)

    def chunks(self) -> Iterator[Chunk]:
        """Yield samples with the answers to their SYNCs, as they come to pass.

        What went wrong in the thread is raised here. Closing this slows down and stops.
        """
        before = sys.getswitchinterval()
        sys.setswitchinterval(min(before, SWITCH_INTERVAL_S))
        self._thread.start()
        try:
            while (chunk := self._chunks.get()) is not None:
                if isinstance(chunk, Exception):
                    raise chunk
                yield chunk
        finally:
            self._halt.set()
            self._thread.join()
            sys.setswitchinterval(before)

    def _run(self) -> None:
        self._due = time.monotonic()
        try:
            for _ in range(TAKE_UP_CYCLES):
                self._hold()
            self._play()
            self._leave()
        except Exception as error:  # noqa: BLE001 it is raised where the samples are awaited
            self._chunks.put(error)
        else:
            self._chunks.put(None)

    def _play(self) -> None:
        """Send every set-point, down to standstill."""
        grid, lead, started = self._grid, self._lead, time.monotonic()
        gathered = _Gathered(self._chunks, max(1, round(CHUNK_S / grid.period_s / grid.stride)))
        for number in range(grid.first, grid.end + 1):
            if self._halt.is_set():
                self._slow_down()
                return
            when = time.monotonic() - started
            # A drive goes to a set-point over the cycle after the SYNC that it came before.
            answers = self._send(grid.phase(number + 1) + lead.at(number))
            lead.learn(number, self._follower.reached(answers))
            if number % grid.stride == 0:
                settling = not 0 <= number <= grid.last
                gathered.add(grid.phase(number), when, answers, settling=settling)
            self._wait()
        gathered.flush()

    def _slow_down(self) -> None:
        """Go on from the speed that was reached, down to standstill, as steeply as the ramp."""
        speed = self._step
        cycles = round(self._grid.ramp * abs(speed / self._grid.step))
        for i in range(cycles):
            self._follower.reached(self._send(self._sent + speed * (1 - (i + 0.5) / cycles)))
            self._wait()

    def _leave(self) -> None:
        """Have the drive do without the SYNC; stand on it until then."""
        with ThreadPoolExecutor(1, "leave") as beside:
            leaving = beside.submit(self._follower.leave)
            while not leaving.done():
                self._hold()
        leaving.result()

    def _hold(self) -> None:
        """Stand for a cycle. Whether the drive follows is no matter."""
        self._send(self._sent)
        self._wait()

    def _send(self, phase: float) -> Answers:
        """Send a phase [rad] with the SYNC; return the answers."""
        self._step, self._sent = phase - self._sent, phase
        return self._follower.exchange(phase)

    def _wait(self) -> None:
        """Wait for the next cycle; cycles that are over already are lost, not made up for."""
        self._due += self._grid.period_s
        left = self._due - time.monotonic()
        if left > 0:
            time.sleep(left)
        late = time.monotonic() - self._due
        self.timing.late_s.append(late)
        if late > self._grid.period_s:
            missed = int(late / self._grid.period_s)
            self.timing.lost += missed
            self._due += missed * self._grid.period_s


class _Gathered:
    """Samples on their way out of the thread, `size` in a chunk, each chunk of one sort."""

    def __init__(self, out: "Queue[Chunk | Exception | None]", size: int) -> None:
        self._out = out
        self._size = size
        self._settling = True
        self._rows: list[tuple[float, float, Answers]] = []

    def add(self, phase: float, when: float, answers: Answers, *, settling: bool) -> None:
        """Add one sample."""
        if settling != self._settling:
            self.flush()
        self._settling = settling
        self._rows.append((phase, when, answers))
        if len(self._rows) >= self._size:
            self.flush()

    def flush(self) -> None:
        """Hand over what has been gathered."""
        if self._rows:
            phase, when, answers = zip(*self._rows, strict=True)
            samples = Samples(np.array(phase), np.array(when), self._settling)
            self._out.put((samples, list(answers)))
            self._rows = []


def _eased(share: float) -> float:
    """Return what of a way is done after a share of its time, both begun and ended gently."""
    done = min(1.0, max(0.0, share))
    return done * done * (3 - 2 * done)
