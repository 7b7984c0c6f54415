"""What every actuator and sensor must do, checked from outside; AssertionError says what is amiss.

Links have to be connected before; the checks connect and close the devices themselves. They move
the actuator: use a simulator, or a bench that may move.
"""

from contextlib import closing
from dataclasses import replace

import numpy as np

from labdrive.interfaces.devices import Acquisition, Actuator, Samples, Sensor
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Direction, Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, WaveformTable

UNITS = {"m", "rad", "N", "K", "V", "A", "s", "Pa"}


def check_actuator(actuator: Actuator, waveform: Waveform | None, motion: Motion) -> None:
    """Check an actuator that is not connected yet: table, motions both ways, every way out."""
    actuator.make_safe()
    actuator.close()
    require(actuator.position_unit in {"m", "rad"}, "position_unit must be m or rad")
    table = _checked_table(actuator, waveform)
    actuator.connect()
    try:
        for direction in _directions(actuator, motion):
            actuator.load(table)
            check_samples(actuator, replace(motion, direction=direction))
        _check_ways_out(actuator, table, motion)
    finally:
        actuator.make_safe()
        actuator.close()
    actuator.close()


def check_sensor(
    sensor: Sensor, actuator: Actuator, waveform: Waveform | None, motion: Motion
) -> None:
    """Check a sensor that is not connected yet, on an actuator that plays the motion for it."""
    sensor.close()
    require(sensor.unit in UNITS, f"unit must be SI ({', '.join(sorted(UNITS))}): {sensor.unit}")
    require(bool(sensor.samplings), "samplings must name at least one kind of sampling")
    actuator.connect()
    sensor.connect()
    try:
        actuator.load(actuator.nominal_table(waveform))
        _check_readings(sensor, actuator, motion)
        _check_readings(sensor, actuator, motion)
    finally:
        actuator.make_safe()
        sensor.close()
        actuator.close()
    sensor.close()


def check_samples(actuator: Actuator, motion: Motion) -> None:
    """Check the samples of a motion with the table that is loaded."""
    chunks = list(actuator.play(Acquisition(1, motion)))
    at = [index for index, chunk in enumerate(chunks) if not chunk.settling]
    require(bool(at), f"{motion.samples} samples are due, but none came")
    require(at[-1] - at[0] == len(at) - 1, "no settling chunk may come between recorded ones")
    require(_sizes_agree(chunks), "each chunk needs as many times as phases")
    time = np.concatenate([chunk.time for chunk in chunks])
    require(bool(np.all(np.diff(time) > 0)), "times must rise over the whole motion")
    phase = np.concatenate([chunks[index].phase for index in at])
    if actuator.sampling is Sampling.TRIGGERED:
        _check_grid(phase, motion)
    elif actuator.fixed_motion is None:
        sense = motion.direction.sign
        require(bool(np.all(sense * np.diff(phase) >= 0)), "phases must follow the direction")


def require(condition: bool, message: str) -> None:
    """Raise AssertionError with `message` unless the condition holds."""
    if not condition:
        raise AssertionError(message)


def _checked_table(actuator: Actuator, waveform: Waveform | None) -> WaveformTable:
    table, again = actuator.nominal_table(waveform), actuator.nominal_table(waveform)
    for one, other in zip(table.channels, again.channels, strict=True):
        require(np.array_equal(one.samples, other.samples), "nominal_table must be repeatable")
        require(bool(np.isfinite(one.samples).all()), f"channel {one.name} must be finite")
        require(len(one.samples) == table.length, "channels must be of one length")
    travel = actuator.travel_per_period(table)
    require(bool(np.isfinite(travel)), "travel_per_period must be a finite number")
    return table


def _directions(actuator: Actuator, motion: Motion) -> tuple[Direction, ...]:
    fixed = actuator.fixed_motion
    return (motion.direction,) if fixed else (motion.direction, motion.direction.opposite)


def _check_ways_out(actuator: Actuator, table: WaveformTable, motion: Motion) -> None:
    """Stop in mid-motion, make safe twice, reference, and go again."""
    with closing(actuator.play(Acquisition(2, motion))) as chunks:
        next(chunks)
    actuator.make_safe()
    actuator.make_safe()
    actuator.reference()
    actuator.load(table)
    check_samples(actuator, motion)


def _sizes_agree(chunks: list[Samples]) -> bool:
    return all(chunk.phase.shape == chunk.time.shape for chunk in chunks)


def _check_grid(phase: FloatArray, motion: Motion) -> None:
    require(
        len(phase) == motion.samples,
        f"{motion.samples} samples are due, both ends included, not {len(phase)}",
    )
    due = motion.direction.sign * TURN * np.arange(motion.samples) / motion.samples_per_period
    off = float(np.max(np.abs(phase - due)))
    require(off < 1e-9, f"phases must be equidistant from 0 on; they are off by {off:.3g} rad")


def _check_readings(sensor: Sensor, actuator: Actuator, motion: Motion) -> None:
    acquisition = Acquisition(1, motion)
    sensor.arm(acquisition)
    last = -np.inf
    with closing(actuator.play(acquisition)) as chunks:
        for samples in chunks:
            reading = sensor.read(samples)
            require(reading.value.shape == reading.time.shape, "each value needs a time")
            require(bool(np.isfinite(reading.value).all()), "readings must be finite")
            if Sampling.TRIGGERED in sensor.samplings:
                same = np.array_equal(reading.time, samples.time)
                require(same, "a triggered sensor reads once a sample, at its time")
            times = np.append(last, reading.time)
            require(bool(np.all(np.diff(times) > 0)), "readings must come in order of time")
            last = times[-1]
