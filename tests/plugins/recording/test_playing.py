"""What was written into a table comes out as phases and readings, whatever the kind of file."""

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from labdrive.interfaces.devices import Acquisition, Samples
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.motion import Direction
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive_recording.table_file import CHUNK_ROWS

THREE = "time_s,x,counts\n10,1,0\n11.5,2,50\n13,4,150\n"


def write_csv(path, columns):
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]))


def write_hdf5(path, columns):
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[name] = column


WRITERS = {
    ".csv": write_csv,
    ".h5": write_hdf5,
    ".nc": write_hdf5,
    ".npz": lambda path, columns: np.savez(path, **columns),
}


@pytest.mark.parametrize("ending", WRITERS)
@given(
    column=st.integers(2, 30).flatmap(
        lambda n: arrays(np.float64, n, elements=st.floats(-1e300, 1e300))
    )
)
def test_every_kind_of_file_keeps_every_bit(tmp_path_factory, sensor, ending, column):
    path = tmp_path_factory.mktemp("tables") / f"table{ending}"
    WRITERS[ending](path, {"a": np.arange(len(column)), "x": column})
    values = sensor(path).read(Samples(np.zeros(len(column)), np.zeros(len(column)))).value
    assert values.tobytes() == column.tobytes()


def test_phase_and_time_follow_from_a_column_of_time(write, actuator, sensor, played):
    path = write(THREE)
    phase, time, values = played(actuator(path, cycle="2 s"), sensor(path, scale="2 mm"))
    np.testing.assert_allclose(phase, TURN * np.array([0, 0.75, 1.5]))
    np.testing.assert_array_equal(time, [0, 1.5, 3])
    np.testing.assert_allclose(values, [2e-3, 4e-3, 8e-3])


def test_a_cycle_of_counts_with_time_of_its_own(write, actuator):
    device = actuator(write(THREE), column="counts", cycle="100 count", time="time_s")
    (samples,) = device.play(Acquisition(1, device.fixed_motion))
    np.testing.assert_allclose(samples.phase, TURN * np.array([0, 0.5, 1.5]))
    np.testing.assert_array_equal(samples.time, [0, 1.5, 3])


def test_without_a_clock_a_cycle_lasts_a_second(write, actuator):
    device = actuator(write(THREE), column="counts", cycle="-100 count")
    (samples,) = device.play(Acquisition(1, device.fixed_motion))
    np.testing.assert_allclose(samples.phase, -TURN * np.array([0, 0.5, 1.5]))
    np.testing.assert_allclose(samples.time, [0, 0.5, 1.5])
    assert device.fixed_motion.direction is Direction.BACKWARD


def test_a_column_in_other_than_si_has_a_scale(write, actuator):
    device = actuator(write("t_ms,x\n0,0\n500,1\n"), column="t_ms", cycle="1 s", scale="1 ms")
    (samples,) = device.play(Acquisition(1, device.fixed_motion))
    np.testing.assert_allclose(samples.phase, [0, TURN / 2])
    np.testing.assert_allclose(samples.time, [0, 0.5])


def test_corrections_count_from_the_row_after_they_were_applied(write, sensor):
    path = write("raw,guide\n1,10\n2,20\n3,30\n")
    device = sensor(path, column="raw", add_running_sum="guide", scale="1 rad")
    assert device.unit == "rad"
    assert device.read(Samples(np.zeros(3), np.zeros(3))).value.tolist() == [1, 12, 33]


def test_the_motion_is_that_of_the_recording(tmp_path, actuator):
    time = np.linspace(5, 15, 1001)
    write_csv(tmp_path / "t.csv", {"time_s": time})
    motion = actuator(tmp_path / "t.csv", cycle="2.5 s").fixed_motion
    assert (motion.periods, motion.samples_per_period, motion.settle_periods) == (4, 250, 0)
    assert motion.period_rate_hz == pytest.approx(0.4)
    assert motion.direction is Direction.FORWARD
    assert motion.samples == 1001


@pytest.mark.parametrize("rows", [CHUNK_ROWS - 1, CHUNK_ROWS, CHUNK_ROWS + 1, 2 * CHUNK_ROWS])
def test_long_recordings_come_in_bounded_chunks_and_repeatedly(
    tmp_path, actuator, sensor, played, rows
):
    path = tmp_path / "long.npz"
    np.savez(path, time_s=np.arange(rows), x=np.arange(rows))
    motor, encoder = actuator(path), sensor(path)
    for _ in range(2):
        phase, time, values = played(motor, encoder)
        assert len(phase) == rows
        np.testing.assert_array_equal(time, np.arange(rows))
        np.testing.assert_array_equal(values, np.arange(rows))


@pytest.mark.parametrize(
    ("phases", "rows"),
    [(3, 2), (2, 3), (99, 98), (99, 100)]
    + [(CHUNK_ROWS + n, CHUNK_ROWS + n + more) for n in (0, 5) for more in (-1, 1)],
)
def test_a_sensor_with_other_rows_than_the_phases_is_refused(
    tmp_path, actuator, sensor, played, phases, rows
):
    np.savez(tmp_path / "phases.npz", time_s=np.arange(phases))
    np.savez(tmp_path / "x.npz", x=np.arange(rows))
    told = rf"sensor encoder holds {rows} rows for \d+( or more)? phases; give actuator and sensor"
    with pytest.raises(DeviceError, match=told):
        played(actuator(tmp_path / "phases.npz"), sensor(tmp_path / "x.npz"))


def test_it_plays_its_own_table_and_no_other(write, actuator):
    device = actuator(write(THREE))
    table = device.nominal_table(None)
    (channel,) = table.channels
    assert (channel.unit, channel.advance) == ("rad", TURN)
    np.testing.assert_allclose(channel.at(np.array([0.0, 1.0, 9.0])), [0, 1, 9], atol=1e-12)
    device.load(table)
    with pytest.raises(DeviceError, match="cannot be driven with another table than its own"):
        device.load(table.with_samples((channel.samples + 1e-9,)))
    with pytest.raises(DeviceError, match="cannot be driven with another table than its own"):
        device.load(WaveformTable((Channel("U", "V", np.zeros(3)), Channel("V", "V", np.ones(3)))))
    with pytest.raises(InputError, match="waveform: a recording has no choice of waveform"):
        device.nominal_table(Waveform(trajectory="box"))


def test_nothing_moves(write, actuator, sensor):
    device = actuator(write(THREE))
    device.connect()
    device.reference()
    device.make_safe()
    device.close()
    assert device.travel_per_period(device.nominal_table(None)) == 0
    assert device.sampling is Sampling.POLLED
    assert sensor(write(THREE)).samplings == {Sampling.POLLED, Sampling.TRIGGERED}
