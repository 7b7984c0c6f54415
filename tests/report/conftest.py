"""Run folders made by hand, in the shape that the engine writes."""

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

TURN = 2 * np.pi

INFO = {
    "id": "20261120T194512Z-optimize-3f9a",
    "kind": "optimize",
    "title": "Linearize the LT40, ellipse",
    "status": "done",
    "reason": "",
    "started": "2026-11-20T19:45:12.5+00:00",
    "ended": "2026-11-20T19:46:42.5+00:00",
    "seed": 7,
    "host": "bench-3",
    "versions": {
        "labdrive": "0.1.0",
        "python": "3.11.7",
        "numpy": "2.4.6",
        "plugins": {"actuators.lt40": "labdrive 0.1.0"},
    },
}


def write_json(path: Path, value):
    path.write_text(json.dumps(value), encoding="utf-8")


def write_recording(path: Path, *, label="iteration 0", periods=8, samples=64, unit="m", rms=2e-7):
    path.parent.mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    count = periods * samples + 1
    phase = TURN * np.arange(count) / samples
    wave = rms * np.sqrt(2) * np.sin(2 * phase)
    reading = 4.5e-6 * phase / TURN + wave + 1e-10 * rng.standard_normal(count)
    with h5py.File(path, "w") as file:
        file["phase"], file["time"], file["interferometer"] = phase, phase / TURN, reading
        for name, of in {"phase": "rad", "time": "s", "interferometer": unit}.items():
            file[name].attrs["units"] = of
        file.attrs.update(label=label, direction="forward", periods=[periods], recording=[1])


def entry(scale, recording, *, order=31, noise=2e-11, seed=0):
    """An entry of result.json whose harmonics fall as those of a walking drive do."""
    rng = np.random.default_rng(seed)
    orders = np.arange(1, order + 1)
    size = scale * np.exp(-0.3 * orders) + noise * np.abs(rng.standard_normal(order))
    phase = rng.uniform(-np.pi, np.pi, order)
    error = (
        size[:, None] * np.cos(np.outer(orders, np.linspace(0, TURN, 999)) + phase[:, None])
    ).sum(0)
    return {
        "step_size": 4.467753971510998e-06,
        "step_size_standard_error": 1.3e-10,
        "periodic_error": {"pv": float(np.ptp(error)), "rms": float(np.sqrt(np.sum(size**2) / 2))},
        "noise_floor": {"rms": noise * order**0.5},
        "harmonics": [
            {"k": int(k), "amplitude": float(a), "phase": float(p), "standard_error": noise}
            for k, a, p in zip(orders, size, phase, strict=True)
        ],
        "recording": recording,
        "label": "characterization",
    }


def write_table(folder: Path, iteration: int, channels: int, length=512):
    """A table of voltages, or with no channels of a spindle's angle."""
    folder.mkdir(exist_ok=True)
    phase = TURN * np.arange(length) / length
    psi = phase + 0.05 * iteration * np.sin(2 * phase)
    outputs = {f"U{i}_V": 24 + 24 * np.cos(psi - i * np.pi / 2) for i in range(channels)}
    columns = {"phase_rad": phase, "psi_rad": psi, **(outputs or {"angle_rad": psi})}
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    (folder / f"iteration-{iteration:02d}.csv").write_text("\n".join(lines) + "\n")


@pytest.fixture
def info():
    return json.loads(json.dumps(INFO))


@pytest.fixture
def optimized(tmp_path) -> Callable[..., Path]:
    """Write the folder of an `optimize` run: 4 channels of voltage, or a spindle with none."""

    def build(channels=4, iterations=3, **changes) -> Path:
        folder = tmp_path / "run"
        folder.mkdir()
        sizes = [2.3e-7 * 40.0**-i for i in range(iterations)]
        entries = [
            entry(size, f"recordings/{i + 1:04d}.h5", seed=i)
            | {"iteration": i, "table": f"iteration-{i:02d}", "remark": ""}
            for i, size in enumerate(sizes)
        ]
        final = f"recordings/{iterations + 1:04d}.h5"
        verification = entry(sizes[-1], final, order=127, seed=9)
        before, after = entries[0]["periodic_error"], verification["periodic_error"]
        result = {
            "kind": "optimize",
            "unit": "m",
            "sensor": "interferometer",
            "iterations": entries,
            "stopped": "noise_floor",
            "best_iteration": iterations - 1,
            "verification": verification,
            "improvement": before["rms"] / after["rms"],
        }
        for number, size in enumerate([*sizes, sizes[-1]], start=1):
            write_recording(folder / f"recordings/{number:04d}.h5", rms=size)
        for number in range(iterations):
            write_table(folder / "tables", number, channels)
        (folder / "recipe.yaml").write_text("kind: optimize\nsensor: interferometer\n")
        (folder / "bench.yaml").write_text("limits:\n  voltage: {min: 0 V, max: 48 V}\n")
        write_json(folder / "run.json", INFO)
        write_json(folder / "result.json", result | changes)
        return folder

    return build


@pytest.fixture
def characterized(tmp_path) -> Path:
    """Write the folder of a `characterize` run of a telescope's worm, in rad."""
    folder = tmp_path / "run"
    folder.mkdir()
    arcsec = np.pi / 648000
    measured = entry(4 * arcsec, "recordings/0001.h5", order=8, noise=0.04 * arcsec)
    measured |= {"step_size": 0.0, "step_size_standard_error": 0.1 * arcsec}
    cycle = {"value": 382.256, "standard_error": 0.53, "unit": "s"}
    head = {"kind": "characterize", "unit": "rad", "sensor": "interferometer"}
    write_json(folder / "result.json", head | measured | {"cycle": cycle, "estimator": "exact"})
    write_json(folder / "run.json", INFO | {"kind": "characterize", "title": "Worm"})
    write_recording(folder / "recordings/0001.h5", unit="rad", rms=3 * arcsec)
    return folder
