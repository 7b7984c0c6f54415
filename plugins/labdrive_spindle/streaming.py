"""Stream set-points on the SYNC's grid from a thread of its own, so that no chunk delays them."""

import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from queue import Queue
from threading import Event, Thread

import numpy as np

from labdrive.interfaces.devices import Samples
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN

CHUNK_S = 0.05
# The interpreter's own is 5 ms, longer than a cycle of the SYNC.
SWITCH_INTERVAL_S = 2e-4

Answers = Mapping[int, bytes]


@dataclass(frozen=True)
class Grid:
    """A motion on the grid of the SYNC: `stride` cycles of it a sample, `ramp` to get up to speed.

    Numbers count cycles of the SYNC; 0 is the first recorded sample.
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
    def first(self) -> int:
        """The first, at standstill."""
        return self.settled_from - self.ramp

    @property
    def settled_from(self) -> int:
        """The first at full rate."""
        return -self.motion.settle_periods * self.per_period

    @property
    def last(self) -> int:
        """The last recorded."""
        return self.motion.periods * self.per_period

    def phase(self, number: int) -> float:
        """Return the phase [rad] at a cycle of the SYNC, the run-up included."""
        before = self.settled_from - number
        run_up = 0.0 if before <= 0 else before - (before**2) / (2 * max(1, self.ramp))
        at = number if before <= 0 else self.settled_from - run_up
        return self.motion.direction.sign * TURN * at / self.per_period

    def run_out(self) -> Iterator[float]:
        """Yield what the phase gains [rad], cycle by cycle, while it slows down to nothing."""
        step = self.motion.direction.sign * TURN / self.per_period
        for i in range(self.ramp):
            yield step * (1 - (i + 0.5) / self.ramp)


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
    little.
    """

    grid: Grid
    phase: float
    _lags: list[float] = field(default_factory=list)
    _correction: float = 0.0

    def at(self, number: int) -> float:
        """Return the lead [rad] at a cycle of the SYNC."""
        _, begin, end = self._cycles
        if number >= begin and self._lags:
            self._correction = math.fsum(self._lags) / len(self._lags)
            self._lags.clear()
        share = min(1.0, max(0.0, (number - begin) / (end - begin)))
        return self.phase + self._correction * share * share * (3 - 2 * share)

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
    """Plays a grid.

    `exchange` sends a phase [rad] with the SYNC and returns what was answered; `reached` says
    which phase [rad] that shows. Both are called from the thread.
    """

    def __init__(
        self,
        grid: Grid,
        exchange: Callable[[float], Answers],
        reached: Callable[[Answers], float],
    ) -> None:
        self.timing = Timing()
        self._grid = grid
        self._exchange = exchange
        self._reached = reached
        # A drive goes to a set-point over the cycle after the SYNC that it came before.
        one = grid.motion.direction.sign * TURN / grid.per_period
        self._lead = Lead(grid, one)
        self._chunks: Queue[tuple[Samples, list[Answers]] | Exception | None] = Queue()
        self._halt = Event()
        self._thread = Thread(target=self._run, name="set-points", daemon=True)

    def chunks(self) -> Iterator[tuple[Samples, list[Answers]]]:
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
        try:
            phase = self._play()
            for gain in self._grid.run_out():
                phase += gain
                self._exchange(phase)
                self._wait()
        except Exception as error:  # noqa: BLE001 it is raised where the samples are awaited
            self._chunks.put(error)
        else:
            self._chunks.put(None)

    def _play(self) -> float:
        """Send every set-point up to the last or a halt; return the last phase sent [rad]."""
        grid, chunk = self._grid, _Chunk(self._chunks)
        self._due = started = time.monotonic()
        size = max(1, round(CHUNK_S / grid.period_s / grid.stride))
        sent = grid.phase(grid.first)
        for number in range(grid.first, grid.last + 1):
            if self._halt.is_set():
                break
            sent = grid.phase(number) + self._lead.at(number)
            when = time.monotonic()
            answers = self._exchange(sent)
            self._lead.learn(number, self._reached(answers))
            if number >= grid.settled_from and number % grid.stride == 0:
                if number == 0:
                    chunk.flush(settling=True)
                chunk.add(grid.phase(number), when - started, answers)
                if len(chunk) >= size:
                    chunk.flush(settling=number < 0)
            self._wait()
        chunk.flush(settling=False)
        return sent

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


class _Chunk:
    """Samples on their way out of the thread."""

    def __init__(self, out: "Queue[tuple[Samples, list[Answers]] | Exception | None]") -> None:
        self._out = out
        self._phase: list[float] = []
        self._time: list[float] = []
        self._answers: list[Answers] = []

    def __len__(self) -> int:
        return len(self._phase)

    def add(self, phase: float, when: float, answers: Answers) -> None:
        """Add one sample."""
        self._phase.append(phase)
        self._time.append(when)
        self._answers.append(answers)

    def flush(self, *, settling: bool) -> None:
        """Hand over what has been gathered."""
        if self._phase:
            samples = Samples(np.array(self._phase), np.array(self._time), settling)
            self._out.put((samples, self._answers))
            self._phase, self._time, self._answers = [], [], []
