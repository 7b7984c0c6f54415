"""Play a waveform table to a plant, entry by entry, as a generator with a clock does."""

import time
from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labdrive.interfaces.devices import Acquisition, Samples
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.motion import Motion
from labdrive.model.waveform import TURN, WaveformTable
from labdrive_sim.plant import Plant

FAST_CHUNK_STEPS = 16384
PACED_CHUNK_S = 0.05
RAMP_STEPS = 512
RAMP_S = 0.1


class TablePlayer:
    """Holds each entry of a table for its share of a cycle and latches sensors on entries.

    The plant sees every entry, however many of them are latched. `speed` is a multiple of real
    time, None for as fast as possible.
    """

    def __init__(self, plant: Plant, length: int, speed: float | None) -> None:
        self._plant = plant
        self._length = length
        self._speed = speed
        self._table: WaveformTable | None = None

    def load(self, table: WaveformTable) -> None:
        """Ramp to the start of the table, from wherever the outputs are, and play it from now on.

        DeviceError if it is not as long as the generator's memory.
        """
        if table.length != self._length:
            raise DeviceError(
                f"the generator plays tables of {self._length} entries, not of {table.length}"
            )
        self._table = table
        self._go_to_start(table)

    def check(self, motion: Motion) -> None:
        """Refuse, by InputError, samples a cycle that are not a whole number of entries apart."""
        if self._length % motion.samples_per_period:
            raise _cannot_be_clocked(motion.samples_per_period, self._length)

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
        """Walk the motion; yield the samples of each chunk once the plant has followed it.

        Refused before anything moves: InputError where entries of the table are not a whole number
        a sample, DeviceError where no table was loaded.
        """
        if self._table is None:
            raise DeviceError("there is no table to play; load one first")
        self.check(acquisition.motion)
        return self._played(self._table, acquisition.motion)

    def relive(self, motion: Motion) -> None:
        """Let the plant follow a motion as fast as it can, with nobody to read it."""
        speed, self._speed = self._speed, None
        try:
            for _ in self.play(Acquisition(0, motion)):
                pass
        finally:
            self._speed = speed

    def _played(self, table: WaveformTable, motion: Motion) -> Generator[Samples, None, None]:
        stride = self._length // motion.samples_per_period
        step_s = 1 / (motion.period_rate_hz * self._length)
        origin = self._go_to_start(table)
        first, started = -motion.settle_periods * self._length, time.monotonic()
        for begin, end in self._chunks(motion, stride, step_s):
            entries = np.arange(begin, end)
            when = np.asarray((entries - first) * step_s, dtype=np.float64)
            outputs = _outputs(table, motion.direction.sign * (entries - first)) + origin
            self._plant.follow(outputs, when, step_s)
            self._wait(started, float(when[-1]))
            latched = slice(0, None, stride)
            phase = motion.direction.sign * TURN * entries[latched] / self._length
            yield Samples(phase, when[latched], settling=begin < 0)

    def _go_to_start(self, table: WaveformTable) -> FloatArray:
        """Ramp to the start of the table; a channel that advances has many: to the nearest.

        Return what the outputs have beyond the table's own, shape (channels,).
        """
        start = np.array([channel.samples[0] for channel in table.channels])
        advance = np.array([channel.advance for channel in table.channels])
        cycles = np.round((self._plant.outputs - start) / np.where(advance == 0, np.inf, advance))
        origin = cycles * advance
        self.ramp(start + origin)
        return np.asarray(origin)

    def _chunks(self, motion: Motion, stride: int, step_s: float) -> Iterator[tuple[int, int]]:
        """Yield (begin, end) of entries, all settling or all recorded, each begun by a sample."""
        paced = np.inf if self._speed is None else PACED_CHUNK_S * self._speed / step_s
        size = stride * max(1, int(min(paced, FAST_CHUNK_STEPS)) // stride)
        settle, last = -motion.settle_periods * self._length, motion.periods * self._length
        # The entry that closes the last cycle is played too, so that the next motion starts there.
        spans = ((settle, 0), (0, last + 1)) if motion.periods else ((settle, 1),)
        for start, stop in spans:
            for begin in range(start, stop, size):
                yield begin, min(begin + size, stop)

    def _wait(self, started: float, until_s: float) -> None:
        """Sleep until the clock on the wall has come as far as the motion."""
        if self._speed is not None:
            time.sleep(max(0.0, started + until_s / self._speed - time.monotonic()))


def walked(plant: Plant, table: WaveformTable, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Walk a plant; return the phase [rad] and its position [m] at every recorded entry."""
    player = TablePlayer(plant, table.length, speed=None)
    player.load(table)
    every = Acquisition(0, replace(motion, samples_per_period=table.length))
    recorded = [
        (samples.phase, plant.stretch.position)
        for samples in player.play(every)
        if not samples.settling
    ]
    phase, position = zip(*recorded, strict=True)
    return np.concatenate(phase), np.concatenate(position)


def _outputs(table: WaveformTable, entries: NDArray[np.int64]) -> FloatArray:
    """Return the outputs of entries counted from the table's start, shape (steps, channels)."""
    cycles, index = np.divmod(entries, table.length)
    columns = [channel.samples[index] + channel.advance * cycles for channel in table.channels]
    return np.stack(columns, axis=1)


def _cannot_be_clocked(samples_per_period: int, length: int) -> InputError:
    fit = [m for m in range(16, length + 1, 2) if length % m == 0]
    near = sorted(sorted(fit, key=lambda m: abs(m - samples_per_period))[:2])
    multiple = max(1, length // samples_per_period) * samples_per_period
    message = (
        f"does not divide the {length} entries of the table; take "
        f"{' or '.join(map(str, near))}, or a table_length of {multiple}"
    )
    return InputError(Problem(message, "motion.samples_per_period", got=str(samples_per_period)))
