"""Play a motion, read every sensor chunk by chunk, and put the samples together."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

from labdrive.engine.limits import Watch
from labdrive.interfaces.devices import Acquisition, Actuator, Reading, Samples, Sensor
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording, Sampling

POSITIONS = {"m", "rad"}
FEWEST_TO_JUDGE = 64


def own_clock(sampling: Sampling, sensors: Mapping[str, Sensor]) -> list[str]:
    """Return the sensors that no trigger can latch: their readings have times of their own.

    An actuator that is polled stands still to be read, so that any sensor is in step with it.
    """
    if sampling is Sampling.POLLED:
        return []
    return [name for name, s in sensors.items() if Sampling.TRIGGERED not in s.samplings]


@dataclass
class _Columns:
    """What has been recorded so far, chunk by chunk."""

    sensors: Mapping[str, Sensor]
    own_clock: bool
    spool: Callable[[Mapping[str, FloatArray]], None]
    phase: list[FloatArray] = field(default_factory=list)
    time: list[FloatArray] = field(default_factory=list)
    values: dict[str, list[FloatArray]] = field(default_factory=dict)
    before: Samples | None = None

    def add(self, samples: Samples, readings: Mapping[str, Reading]) -> int:
        """Add a chunk; return the number of samples it brought."""
        times = self._common_time(samples, readings)
        known = samples if self.before is None else _joined(self.before, samples)
        self.before = Samples(samples.phase[-1:], samples.time[-1:])
        if samples.settling:
            return 0
        phase = _phase_at(known, times) if self.own_clock else samples.phase
        self.time.append(times)
        self.phase.append(phase)
        for name, reading in readings.items():
            self.values.setdefault(name, []).append(reading.value)
        values = {name: reading.value for name, reading in readings.items()}
        self.spool({"phase": phase, "time": times, **values})
        return len(times)

    def _common_time(self, samples: Samples, readings: Mapping[str, Reading]) -> FloatArray:
        if self.own_clock:
            return next(iter(readings.values())).time
        for name, reading in readings.items():
            if len(reading.value) != len(samples.phase):
                raise DeviceError(
                    f"sensor {name} gave {len(reading.value)} readings for {len(samples.phase)} "
                    "samples; a trigger was missed or counted twice"
                )
        return samples.time


def _joined(before: Samples, now: Samples) -> Samples:
    return Samples(np.append(before.phase, now.phase), np.append(before.time, now.time))


def _phase_at(samples: Samples, time: FloatArray) -> FloatArray:
    """Phase of the motion at readings' own times; the motion is linear between its samples."""
    return np.asarray(np.interp(time, samples.time, samples.phase), dtype=np.float64)


def acquire(  # noqa: PLR0913 what a recording is made of
    actuators: Sequence[Actuator],
    sensors: Mapping[str, Sensor],
    acquisition: Acquisition,
    watch: Watch,
    label: str,
    progress: Callable[[int], None],
    spool: Callable[[Mapping[str, FloatArray]], None],
) -> Recording:
    """Play the motion with the loaded tables and return what every sensor read.

    `spool` is given each chunk's columns as they come, `progress` the count of samples.

    Each chunk is held against the limits before the next is asked for; whatever is raised, the
    motion is halted by closing the actuators' iterators.
    """
    sampling = actuators[0].sampling
    columns = _Columns(sensors, bool(own_clock(sampling, sensors)), spool)
    for sensor in sensors.values():
        sensor.arm(acquisition)
    count = 0
    with closing(_in_step(actuators, acquisition)) as chunks:
        for samples in chunks:
            readings = {name: sensor.read(samples) for name, sensor in sensors.items()}
            for name, reading in readings.items():
                watch.check(name, reading)
            count += columns.add(samples, readings)
            progress(count)
    return _recording(columns, acquisition, sampling, label)


def walk(
    actuators: Sequence[Actuator],
    sensors: Mapping[str, Sensor],
    acquisition: Acquisition,
    watch: Watch,
    alive: Callable[[], None],
) -> None:
    """Play a motion that records nothing, held against the limits all the same.

    `alive` is called after each chunk.
    """
    for sensor in sensors.values():
        sensor.arm(acquisition)
    with closing(_in_step(actuators, acquisition)) as chunks:
        for samples in chunks:
            for name, sensor in sensors.items():
                watch.check(name, sensor.read(samples))
            alive()


def _in_step(
    actuators: Sequence[Actuator], acquisition: Acquisition
) -> Generator[Samples, None, None]:
    """Play one motion on every actuator, chunk by chunk; all halt when this is closed.

    DeviceError if their clocks do not go together.
    """
    with ExitStack() as stack:
        chunks = [stack.enter_context(closing(a.play(acquisition))) for a in actuators]
        for first, *others in zip_longest(*chunks):
            for other in others:
                if first is None or other is None or not np.array_equal(first.phase, other.phase):
                    raise DeviceError(
                        "the actuators cannot walk in step: their clocks give other phases; drive "
                        "them one after the other"
                    )
            yield first


def _recording(
    columns: _Columns, acquisition: Acquisition, sampling: Sampling, label: str
) -> Recording:
    if not columns.time:
        raise DeviceError(f"nothing was recorded during {label!r}: the actuator gave no samples")
    motion = acquisition.motion
    _refuse_stuck(columns, motion)
    return Recording(
        number=acquisition.number,
        label=label,
        phase=np.concatenate(columns.phase),
        time=np.concatenate(columns.time),
        readings={name: np.concatenate(parts) for name, parts in columns.values.items()},
        units={name: sensor.unit for name, sensor in columns.sensors.items()},
        samples_per_period=motion.samples_per_period,
        periods=motion.periods,
        direction=motion.direction,
        sampling=Sampling.POLLED if columns.own_clock else sampling,
    )


def _refuse_stuck(columns: _Columns, motion: Motion) -> None:
    """Raise DeviceError for a sensor of position that saw nothing of a whole cycle or more."""
    for name, parts in columns.values.items():
        moved = columns.sensors[name].unit in POSITIONS and motion.periods
        values = np.concatenate(parts)
        if moved and len(values) >= FEWEST_TO_JUDGE and np.ptp(values) == 0:
            raise DeviceError(
                f"sensor {name} read {values[0]:g} throughout: it has not changed while the "
                "actuator moved; is it stuck, or looking elsewhere?"
            )
