"""Read the sensors over one motion: within the limits, as often as is due, and still alive."""

from collections.abc import Mapping

import numpy as np

from labdrive.engine.limits import Watch
from labdrive.engine.stillness import Stillness
from labdrive.interfaces.devices import Acquisition, Reading, Samples, Sensor
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN

POSITIONS = {"m", "rad"}
# A walk back has no settling cycles of its own; what was reversed may lag for a while, too.
REVERSAL_CYCLES = 2


def own_clock(sampling: Sampling, sensors: Mapping[str, Sensor]) -> list[str]:
    """Return the sensors that no trigger can latch: their readings have times of their own.

    An actuator that is polled stands still to be read, so that any sensor is in step with it.
    """
    if sampling is Sampling.POLLED:
        return []
    return [name for name, s in sensors.items() if Sampling.TRIGGERED not in s.samplings]


class Sensing:
    """The sensors of a bench over one motion, of which the actuator gives the samples."""

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        sampling: Sampling,
        acquisition: Acquisition,
        watch: Watch,
    ) -> None:
        """Arm every sensor."""
        self.sensors = sensors
        self.own_clock = bool(own_clock(sampling, sensors))
        self._watch = watch
        self._settled_after = TURN * _settling_cycles(acquisition.motion)
        # A walk back may be of another sort than the motion: sensors that nothing is held on need
        # not see it.
        recorded = acquisition.motion.periods > 0
        self._due = {name for name in sensors if recorded or watch.guards(name)}
        self._start: float | None = None
        self._heard: dict[str, float] = {}
        self._still = {
            name: Stillness(name, watch.values_a_cycle.get(name, 0.0))
            for name, sensor in sensors.items()
            if sensor.unit in POSITIONS
        }
        for sensor in sensors.values():
            sensor.arm(acquisition)

    def read(self, samples: Samples) -> dict[str, Reading]:
        """Return what each sensor read over a chunk, once that is held against the limits.

        InterlockError, PausedError as `Watch.check`; DeviceError for a sensor that gives too few
        readings, or always the same.
        """
        readings = {name: sensor.read(samples) for name, sensor in self.sensors.items()}
        for name, reading in readings.items():
            self._watch.check(name, reading)
        if len(samples.phase) and self._start is None:
            self._start = float(samples.phase[0])
        for name, reading in readings.items():
            self._refuse_missing(name, reading, samples)
            self._refuse_still(name, reading, samples)
        return readings

    def _refuse_missing(self, name: str, reading: Reading, samples: Samples) -> None:
        due, count = len(samples.phase), len(reading.value)
        if self.own_clock:
            self._refuse_silence(name, reading, samples)
        elif count != due and (count or name in self._due):
            raise DeviceError(
                f"sensor {name} gave {count} readings for {due} samples; a trigger was missed or "
                "counted twice"
            )

    def _refuse_silence(self, name: str, reading: Reading, samples: Samples) -> None:
        if len(samples.time) == 0:
            return
        heard = self._heard.setdefault(name, float(samples.time[0]))
        if len(reading.time):
            heard = self._heard[name] = float(reading.time[-1])
        silence = float(samples.time[-1]) - heard
        if silence > self._watch.silence_s:
            raise DeviceError(
                f"sensor {name} gave no reading for {silence:.3g} s of motion; is it switched on "
                "and connected?"
            )

    def _refuse_still(self, name: str, reading: Reading, samples: Samples) -> None:
        still = self._still.get(name)
        if still is None or self._start is None or len(reading.value) == 0:
            return
        phase = self._phase(reading, samples)
        settled = np.abs(phase - self._start) >= self._settled_after
        still.add(phase[settled], reading.value[settled])
        self._watch.values_a_cycle[name] = still.values_a_cycle

    def _phase(self, reading: Reading, samples: Samples) -> FloatArray:
        if not self.own_clock:
            return samples.phase
        return np.asarray(np.interp(reading.time, samples.time, samples.phase), dtype=np.float64)


def _settling_cycles(motion: Motion) -> int:
    """Return over how many cycles a sensor may stand still, as after a reversal."""
    return motion.settle_periods if motion.periods else REVERSAL_CYCLES
