"""Play a waveform table to a plant, entry by entry, as a generator with a clock does."""

import time
from collections.abc import Generator, Iterator

import numpy as np

from labdrive.interfaces.devices import Acquisition, Samples
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN, WaveformTable
from labdrive_sim.plant import Plant

FAST_CHUNK_STEPS = 16384
PACED_CHUNK_S = 0.05
RAMP_STEPS = 512
RAMP_S = 0.1


class TablePlayer:
    """Holds each entry of the table for its share of a cycle and latches sensors on entries.

    `speed` is a multiple of real time, None for as fast as possible.
    """

    def __init__(self, plant: Plant, length: int, speed: float | None) -> None:
        self._plant = plant
        self._length = length
        self._speed = speed
        self._table: WaveformTable | None = None
        self._origin: FloatArray = np.zeros(0)

    def load(self, table: WaveformTable) -> None:
        """Ramp to the start of the table, from wherever the outputs are, and play it from now on.

        A channel that advances goes to the nearest of its starts.
        """
        if table.length != self._length:
            raise DeviceError(
                f"the generator holds tables of {self._length} entries, not {table.length}"
            )
        start = np.array([channel.samples[0] for channel in table.channels])
        advance = np.array([channel.advance for channel in table.channels])
        turns = np.round((self._plant.outputs - start) / np.where(advance == 0, np.inf, advance))
        self._table, self._origin = table, turns * advance
        self.ramp(start + self._origin)

    def ramp(self, target: FloatArray) -> None:
        """Bring the outputs to `target`, shape (channels,), along a straight line."""
        here = self._plant.outputs
        if np.array_equal(here, target):
            return
        share = np.arange(1, RAMP_STEPS + 1)[:, np.newaxis] / RAMP_STEPS
        step_s = RAMP_S / RAMP_STEPS
        when = step_s * np.arange(RAMP_STEPS, dtype=np.float64)
        self._plant.follow(here + share * (target - here), when, step_s)

    def play(self, acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Walk the motion; yield the samples of each chunk once the plant has followed it."""
        motion = acquisition.motion
        stride = self._stride(motion)
        step_s = 1 / (motion.period_rate_hz * self._length)
        first = -motion.settle_periods * self._length
        started = time.monotonic()
        for begin, end in self._chunks(motion, step_s):
            entries = np.arange(begin, end)
            when = np.asarray((entries - first) * step_s, dtype=np.float64)
            self._plant.follow(self._outputs(motion, entries), when, step_s)
            self._wait(started, float(when[-1]))
            latched = entries % stride == 0
            phase = motion.direction.sign * TURN * entries[latched] / self._length
            yield Samples(phase, when[latched], settling=begin < 0)
        if self._table is not None:
            self._origin = self._origin + self._advanced(motion)

    def _stride(self, motion: Motion) -> int:
        """Return entries of the table between samples."""
        stride, rest = divmod(self._length, motion.samples_per_period)
        if rest or self._table is None:
            why = "no table was loaded" if self._table is None else "cannot be clocked"
            raise DeviceError(
                f"{motion.samples_per_period} samples a cycle of {self._length} entries: {why}"
            )
        return stride

    def _chunks(self, motion: Motion, step_s: float) -> Iterator[tuple[int, int]]:
        """Yield (begin, end) of entries; none holds both settling and recorded ones."""
        size = FAST_CHUNK_STEPS
        if self._speed is not None:
            size = max(1, round(PACED_CHUNK_S * self._speed / step_s))
        last = motion.periods * self._length + (1 if motion.periods else 0)
        for start, stop in ((-motion.settle_periods * self._length, 0), (0, last)):
            for begin in range(start, stop, size):
                yield begin, min(begin + size, stop)

    def _outputs(self, motion: Motion, entries: np.ndarray) -> FloatArray:
        """Return the outputs of entries counted along the motion, shape (steps, channels)."""
        assert self._table is not None  # noqa: S101 _stride has seen to it
        signed = motion.direction.sign * entries
        cycles, index = np.divmod(signed + self._settled(motion), self._length)
        columns = [
            channel.samples[index] + channel.advance * cycles for channel in self._table.channels
        ]
        return np.ascontiguousarray(np.transpose(columns) + self._origin)

    def _settled(self, motion: Motion) -> int:
        """Return the entries walked before the recorded ones, signed."""
        return motion.direction.sign * motion.settle_periods * self._length

    def _advanced(self, motion: Motion) -> FloatArray:
        assert self._table is not None  # noqa: S101 _stride has seen to it
        cycles = motion.direction.sign * (motion.settle_periods + motion.periods)
        return np.array([channel.advance * cycles for channel in self._table.channels])

    def _wait(self, started: float, until_s: float) -> None:
        """Sleep until the clock on the wall has come as far as the motion."""
        if self._speed is not None:
            time.sleep(max(0.0, started + until_s / self._speed - time.monotonic()))
