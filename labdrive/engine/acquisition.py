"""Play a motion, read every sensor chunk by chunk, and put the samples together."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

from labdrive.engine.limits import Watch
from labdrive.engine.sensing import POSITIONS, Sensing
from labdrive.engine.stillness import FEWEST_TO_JUDGE
from labdrive.interfaces.devices import Acquisition, Actuator, Reading, Samples, Sensor
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording, Sampling


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
        times = next(iter(readings.values())).time if self.own_clock else samples.time
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
    sensing = Sensing(sensors, sampling, acquisition, watch)
    columns = _Columns(sensors, sensing.own_clock, spool)
    count = 0
    with closing(_in_step(actuators, acquisition)) as chunks:
        for samples in chunks:
            count += columns.add(samples, sensing.read(samples))
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
    sensing = Sensing(sensors, actuators[0].sampling, acquisition, watch)
    with closing(_in_step(actuators, acquisition)) as chunks:
        for samples in chunks:
            sensing.read(samples)
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
    if not sum(map(len, columns.time)):
        raise DeviceError(f"nothing was recorded during {label!r}: there are no samples")
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
