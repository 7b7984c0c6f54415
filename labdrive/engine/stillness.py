"""Notice a sensor of position that has stopped telling positions apart while the actuator moves."""

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive.model.waveform import TURN

FEWEST_TO_JUDGE = 64
FEWEST_VALUES = 8


class Stillness:
    """What one sensor has read since it last changed, over one motion.

    A motion is the same cycle by cycle, and so is what a sensor tells apart of it. One reading on
    and on for a whole cycle or more, where as many cycles held `FEWEST_TO_JUDGE` values before, is
    no reading. An encoder too coarse for that has counts that last for cycles, and is left alone.
    """

    def __init__(self, name: str, values_a_cycle: float = 0.0) -> None:
        """`values_a_cycle` is how many values it told apart in a cycle of earlier motions."""
        self.values_a_cycle = values_a_cycle
        self._name = name
        # What it reads now, since which phase [rad], and how often it has.
        self._value: FloatArray = np.zeros(0)
        self._since: FloatArray = np.zeros(0)
        self._count = 0
        self._seen: set[float] = set()
        self._seen_from = 0.0

    def add(self, phase: FloatArray, value: FloatArray) -> None:
        """Take readings at phases [rad]; DeviceError if they show that it has stopped."""
        if len(value) == 0:
            return
        self._learn(phase, value)
        phase, value = np.append(self._since, phase), np.append(self._value, value)
        starts = np.append(0, np.flatnonzero(np.diff(value)) + 1)
        ends = np.append(starts[1:], len(value)) - 1
        counts = ends - starts + 1
        counts[0] += max(0, self._count - 1)
        cycles = np.abs(phase[ends] - phase[starts]) / TURN
        self._judge(value[starts], counts, cycles)
        self._value, self._since, self._count = value[-1:], phase[starts[-1:]], int(counts[-1])

    def _learn(self, phase: FloatArray, value: FloatArray) -> None:
        """Count the values of a cycle; those of a part of one are the least it holds."""
        if self.values_a_cycle >= FEWEST_TO_JUDGE:
            return
        if not self._seen:
            self._seen_from = float(phase[0])
        self._seen.update(value.tolist())
        cycles = abs(float(phase[-1]) - self._seen_from) / TURN
        self.values_a_cycle = max(self.values_a_cycle, len(self._seen) / max(1.0, cycles))
        if cycles >= 1:
            self._seen.clear()

    def _judge(self, value: FloatArray, counts: FloatArray, cycles: FloatArray) -> None:
        """Raise DeviceError if any stretch of one value is longer than the motion explains."""
        if self.values_a_cycle < FEWEST_VALUES:
            return
        missed = cycles * self.values_a_cycle
        still = (cycles >= 1) & (counts >= FEWEST_TO_JUDGE) & (missed >= FEWEST_TO_JUDGE)
        if still.any():
            first = int(np.argmax(still))
            raise DeviceError(
                f"sensor {self._name} read {value[first]:g} for {cycles[first]:.3g} cycles of "
                "motion: it has not changed while the actuator moved; is it stuck, or is "
                "something held fast?"
            )
