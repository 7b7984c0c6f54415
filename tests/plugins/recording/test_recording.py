"""Recordings made elsewhere: real files, every format, and every way a file can be wrong."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from labdrive.engine.devices import build
from labdrive.engine.discovery import discover
from labdrive.interfaces.devices import Acquisition
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.motion import Direction
from labdrive.recipe.load import load_bench

DATA = Path(__file__).parents[3] / "recipes" / "data"
BENCH = """\
actuators:
  table: {{plugin: recording, file: {file}, phase: {{column: x, cycle: {cycle}}}{more}}}
sensors:
  gauge: {{plugin: recording, file: {file}, column: y, scale: 2 um}}
"""


@pytest.fixture(scope="module")
def plugins():
    return discover().plugins


@pytest.fixture
def bench(tmp_path, plugins):
    """Build the bench of a YAML text beside the files of this test."""

    def make(text):
        path = tmp_path / "bench.yaml"
        path.write_text(text)
        loaded = load_bench(path, plugins)
        return build(loaded, plugins, next(iter(loaded.actuators)), 1, path.parent)

    return make


def played(devices):
    """Return phase, time and readings by sensor over the whole recording."""
    acquisition = Acquisition(1, devices.fixed_motion)
    for sensor in devices.sensors.values():
        sensor.arm(acquisition)
    phase, time, values = [], [], {name: [] for name in devices.sensors}
    for samples in devices.actuator.play(acquisition):
        phase.append(samples.phase)
        time.append(samples.time)
        for name, sensor in devices.sensors.items():
            values[name].append(sensor.read(samples).value)
    return (
        np.concatenate(phase),
        np.concatenate(time),
        {name: np.concatenate(parts) for name, parts in values.items()},
    )


def write_csv(path, x, y):
    rows = [f"{a!r},{b!r}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    path.write_text("\n".join(["x, y", *rows]) + "\n")


def write_h5(path, x, y):
    with h5py.File(path, "w") as file:
        file["x"], file["y"] = x, y


def write_npz(path, x, y):
    np.savez(path, x=x, y=y)


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=50),
    st.sampled_from([("t.csv", write_csv), ("t.h5", write_h5), ("t.npz", write_npz)]),
)
def test_every_format_gives_the_very_numbers(bench, tmp_path, values, form):
    name, write = form
    x, y = np.arange(len(values)) * 0.25, np.array(values)
    write(tmp_path / name, x, y)
    phase, time, readings = played(bench(BENCH.format(file=name, cycle="1 s", more="")))
    np.testing.assert_array_equal(phase, 2 * np.pi * x)
    np.testing.assert_array_equal(time, x)
    np.testing.assert_array_equal(readings["gauge"], 2e-6 * y)


def test_long_recordings_come_in_bounded_chunks(bench, tmp_path):
    x = np.arange(200_001) / 1000
    write_npz(tmp_path / "t.npz", x, np.sin(x))
    devices = bench(BENCH.format(file="t.npz", cycle="1 s", more=""))
    chunks = list(devices.actuator.play(Acquisition(1, devices.fixed_motion)))
    assert max(len(chunk.phase) for chunk in chunks) <= 65536
    assert sum(len(chunk.phase) for chunk in chunks) == 200_001
    motion = devices.fixed_motion
    assert (motion.periods, motion.samples_per_period) == (200, 1000)
    assert motion.period_rate_hz == pytest.approx(1.0)


def test_a_falling_column_is_travel_backward_and_scale_gives_its_unit(bench, tmp_path):
    write_npz(tmp_path / "t.npz", -np.arange(101) * 10.0, np.zeros(101))
    text = BENCH.format(file="t.npz", cycle="0.1 s", more="").replace(
        "cycle: 0.1 s", "cycle: 0.1 s, scale: 1 ms"
    )
    devices = bench(text)
    assert devices.fixed_motion.direction is Direction.BACKWARD
    phase, _, _ = played(devices)
    np.testing.assert_allclose(phase, -2 * np.pi * np.arange(101) * 0.1)


def test_a_phase_of_counts_takes_its_time_from_another_column(bench, tmp_path):
    (tmp_path / "t.csv").write_text("x,y,when\n0,1,5.0\n512,2,5.5\n1024,3,6.5\n")
    text = BENCH.format(file="t.csv", cycle="1024 count", more=", time: when")
    phase, time, _ = played(bench(text))
    np.testing.assert_allclose(phase, [0, np.pi, 2 * np.pi])
    np.testing.assert_allclose(time, [0, 0.5, 1.5])


GOOD = "x,y\n0,1\n1,2\n2,3\n"


@pytest.mark.parametrize(
    ("content", "change", "said"),
    [
        (GOOD, ("column: y", "column: z"), "no column 'z' among x, y"),
        (
            GOOD.replace("y", "position"),
            ("column: y", "column: positon"),
            "did you mean 'position'",
        ),
        ("x,y\n0,1\n1,much\n", None, "t.csv:3: column 'y' holds no number here (got 'much')"),
        ("x,y\n0,1\n1\n", None, "t.csv:3: column 'y' holds no number"),
        ("x,y\n0,1\n1,nan\n2,3\n", None, "holds nan in row 2"),
        ("x,y\n", None, "holds 0 rows"),
        ("", None, "no header line"),
        (GOOD, ("file: t.csv,", "file: t.csv, header: 'Frame,',"), "starts with 'Frame,'"),
        (GOOD, ("cycle: 1 s", "cycle: 0 s"), "actuators.table.phase.cycle: must not be 0"),
        (GOOD, ("cycle: 1 s", "cycle: 1 s, scale: 1 um"), "must have the unit of the cycle, s"),
        (GOOD.replace("2,3", "0,3"), None, "does not advance"),
        (GOOD, ("cycle: 1 s", "cycle: 1"), "needs a unit"),
        (GOOD, ("scale: 2 um", "scale: 2"), "needs a unit"),
        (GOOD, ("t.csv", "lost.csv"), "there is no file"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(bench, tmp_path, content, change, said):
    (tmp_path / "t.csv").write_text(content)
    text = BENCH.format(file="t.csv", cycle="1 s", more="")
    with pytest.raises(InputError) as raised:
        bench(text.replace(*change) if change else text)
    assert said in str(raised.value)


@pytest.mark.parametrize("name", ["t.h5", "t.npz"])
def test_a_file_that_is_not_what_it_says_is_named(bench, tmp_path, name):
    (tmp_path / name).write_bytes(b"not at all")
    with pytest.raises(InputError, match="cannot be read as"):
        bench(BENCH.format(file=name, cycle="1 s", more=""))


def test_columns_that_differ_in_length_or_shape_are_refused(bench, tmp_path):
    np.savez(tmp_path / "t.npz", x=np.arange(3.0), when=np.arange(4.0), y=np.zeros((3, 2)))
    with pytest.raises(InputError, match="differ in length"):
        bench(BENCH.format(file="t.npz", cycle="1 m", more=", time: when"))
    with pytest.raises(InputError, match="'y' is no column of numbers"):
        bench(BENCH.format(file="t.npz", cycle="1 s", more=""))


def test_a_sensor_with_fewer_rows_than_phases_is_an_error_not_a_shift(bench, tmp_path):
    (tmp_path / "t.csv").write_text(GOOD)
    (tmp_path / "u.csv").write_text("x,y\n0,1\n1,2\n")
    text = BENCH.format(file="t.csv", cycle="1 s", more="").replace(
        "file: t.csv, column", "file: u.csv, column"
    )
    with pytest.raises(DeviceError, match="sensor gauge holds 2 rows, fewer than the phases"):
        played(bench(text))


def test_a_recording_cannot_be_driven(bench, tmp_path):
    (tmp_path / "t.csv").write_text(GOOD)
    actuator = bench(BENCH.format(file="t.csv", cycle="1 s", more="")).actuator
    table = actuator.nominal_table(None)
    actuator.load(table)
    with pytest.raises(DeviceError, match="cannot be driven"):
        actuator.load(table.with_samples((table.channels[0].samples + 0.1,)))
    with pytest.raises(InputError, match="no choice of waveform"):
        actuator.nominal_table(Waveform(trajectory="box"))


@pytest.fixture
def real():
    """The folder of real recordings."""
    missing = [name for name in ("odrive", "phd2") if not (DATA / name).is_dir()]
    assert not missing, f"{missing} not in {DATA}: see its README, or `make data SOURCE=DIR`"
    return DATA


GUIDE_LOG = """\
actuators:
  mount:
    plugin: recording
    file: {file}
    header: "Frame,"
    only: {{column: mount, equals: Mount}}
    phase: {{column: Time, cycle: 382.5 s}}
sensors:
  gear:
    plugin: recording
    file: {file}
    header: "Frame,"
    only: {{column: mount, equals: Mount}}
    column: RARawDistance
    add_running_sum: RAGuideDistance
    scale: 1 arcsec
"""


@pytest.mark.parametrize("name", ["phd2_perf01", "phd2_perf02", "phd2_perf03", "phd2_perf05"])
def test_guide_logs_give_the_gear_error_without_lost_frames_and_remarks(bench, real, name):
    path = real / "phd2" / f"{name}.txt"
    _, time, readings = played(bench(GUIDE_LOG.format(file=path.resolve())))
    frames = [line.split(",") for line in path.read_text(errors="replace").splitlines()]
    frames = [cells for cells in frames if len(cells) > 8 and cells[2] == '"Mount"']
    assert len(time) == len(frames) > 100
    error, applied = [], 0.0
    for cells in frames:
        error.append(float(cells[5]) + applied)
        applied += float(cells[7])
    arcsec = np.degrees(readings["gear"]) * 3600
    np.testing.assert_allclose(arcsec, error, atol=1e-9)
    np.testing.assert_allclose(time, [float(c[1]) - float(frames[0][1]) for c in frames], atol=1e-9)


def test_the_motor_turns_seven_electrical_cycles(bench, real, plugins):
    path = Path(__file__).parents[3] / "recipes" / "benches" / "odrive-recording.yaml"
    devices = build(load_bench(path, plugins), plugins, "motor", 1, path.parent)
    assert devices.fixed_motion.periods == 7
    phase, _, readings = played(devices)
    assert np.ptp(readings["encoder"]) == pytest.approx(2 * np.pi, rel=0.02)
    assert np.ptp(phase) == pytest.approx(7 * 2 * np.pi, rel=0.01)
    # Jittered sampling is the point: these phases are not equidistant.
    assert np.std(np.diff(phase)) > 0.05 * np.mean(np.diff(phase))
