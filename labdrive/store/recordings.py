"""Recordings on disk: one netCDF-4/HDF5 file each, whole or absent."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labdrive.model.errors import StoreError
from labdrive.model.motion import Direction
from labdrive.model.recording import Recording, Sampling
from labdrive.store.durable import written_aside
from labdrive.store.patient_file import patient

AXES = {"phase": "rad", "time": "s"}
RESERVED = {*AXES, "sample"}
LONG_NAMES = {"phase": "commanded phase", "time": "time since the motion began"}


@dataclass(frozen=True)
class StoredRecording:
    """Where a recording is, relative to the run folder, and what its file must hash to."""

    file: str
    sha256: str


def write_recording(folder: Path, recording: Recording) -> StoredRecording:
    """Write `folder`/0001.h5; it is whole and on the disk when this returns.

    `xarray.open_dataset` reads it: dimension `sample`, variables `phase`, `time` and one for each
    sensor with `units`. StoreError if it cannot be written, or a sensor is called phase, time or
    sample.
    """
    for clash in sorted(RESERVED & recording.readings.keys()):
        raise StoreError(f"a sensor cannot be called {clash!r}; rename it in the bench")
    path = folder / f"{recording.number:04d}.h5"
    with written_aside(path) as aside:
        _write(aside, recording)
        sha256 = file_sha256(aside)
    return StoredRecording(f"{folder.name}/{path.name}", sha256)


def read_recording(path: Path, sha256: str | None = None) -> Recording:
    """Read a recording back, bit for bit.

    StoreError, naming the file, if it is missing, damaged, or not the one of that hash.
    """
    import h5py

    try:
        if sha256 is not None and file_sha256(path) != sha256:
            raise StoreError(f"{path} is damaged: its content is not what the journal noted")
        with h5py.File(path, "r") as file:
            return _read(file)
    except (OSError, KeyError, ValueError) as error:
        raise StoreError(f"cannot read the recording {path}: {error}") from error


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _write(path: Path, recording: Recording) -> None:
    import h5netcdf

    columns = {"phase": recording.phase, "time": recording.time, **recording.readings}
    units = {**AXES, **recording.units}
    # Not compressed: at 10^7 samples gzip takes twice as long to write, for a quarter of the size.
    with patient(path) as target, h5netcdf.File(target, "w") as file:
        file.dimensions = {"sample": len(recording.phase)}
        for name, values in columns.items():
            variable = file.create_variable(name, ("sample",), data=np.asarray(values, "f8"))
            variable.attrs["units"] = units[name]
            variable.attrs["long_name"] = LONG_NAMES.get(name, f"reading of {name}")
        file.attrs.update(
            recording=recording.number,
            label=recording.label,
            direction=str(recording.direction),
            sampling=str(recording.sampling),
            samples_per_period=recording.samples_per_period,
            periods=recording.periods,
        )


def _read(file: Any) -> Recording:
    attrs = file.attrs  # netCDF keeps numbers as arrays of one
    sensors = [name for name in file if name not in AXES and "units" in file[name].attrs]
    return Recording(
        number=int(np.ravel(attrs["recording"])[0]),
        label=str(attrs["label"]),
        phase=file["phase"][:],
        time=file["time"][:],
        readings={name: file[name][:] for name in sensors},
        units={name: str(file[name].attrs["units"]) for name in sensors},
        samples_per_period=int(np.ravel(attrs["samples_per_period"])[0]),
        periods=int(np.ravel(attrs["periods"])[0]),
        direction=Direction(str(attrs["direction"])),
        sampling=Sampling(str(attrs["sampling"])),
    )
