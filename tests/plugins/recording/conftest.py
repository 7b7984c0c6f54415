"""Devices of the plugin, made as a bench makes them, and the real recordings."""

from pathlib import Path

import numpy as np
import pytest

from labdrive.interfaces.devices import Acquisition, DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive_recording.actuator import RecordedActuator
from labdrive_recording.sensor import RecordedSensor

DATA = Path(__file__).parents[3] / "recipes" / "data"


@pytest.fixture
def recordings():
    missing = [name for name in ("odrive", "phd2", "laas", "nmm") if not (DATA / name).is_dir()]
    if missing:
        pytest.fail(f"no recipes/data/{missing[0]}; run make data SOURCE=DIR, see {DATA}/README.md")
    return DATA


def make(device, name, settings):
    context = DeviceContext(name, Limits())
    return device(device.Settings.model_validate(settings), context)


@pytest.fixture(scope="session")
def actuator():
    """Make an actuator: actuator(file, column, cycle, **settings)."""

    def actuator(file, column="time_s", cycle="2 s", scale=None, **settings):
        phase = {"column": column, "cycle": cycle, "scale": scale}
        return make(RecordedActuator, "motor", {"file": file, "phase": phase, **settings})

    return actuator


@pytest.fixture(scope="session")
def sensor():
    """Make a sensor: sensor(file, column, scale, **settings)."""

    def sensor(file, column="x", scale="1 m", **settings):
        return make(
            RecordedSensor, "encoder", {"file": file, "column": column, "scale": scale, **settings}
        )

    return sensor


@pytest.fixture(scope="session")
def played():
    """Play a recording through actuator and sensor: phase, time and values, whole."""

    def played(actuator, sensor):
        acquisition = Acquisition(1, actuator.fixed_motion)
        sensor.arm(acquisition)
        chunks = [(samples, sensor.read(samples)) for samples in actuator.play(acquisition)]
        assert all(len(samples.phase) <= 65536 and not samples.settling for samples, _ in chunks)
        assert all(np.array_equal(s.time, r.time) for s, r in chunks)
        return (
            np.concatenate([samples.phase for samples, _ in chunks]),
            np.concatenate([samples.time for samples, _ in chunks]),
            np.concatenate([reading.value for _, reading in chunks]),
        )

    return played


@pytest.fixture
def write(tmp_path):
    """Write text into a file: write(text, name)."""

    def write(text, name="table.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write
