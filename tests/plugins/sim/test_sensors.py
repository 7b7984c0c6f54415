"""What simulated sensors add to the truth, and that they add the same again when asked again."""

import numpy as np
import pytest

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.limits import Limits
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN
from labdrive_sim.table_player import FAST_CHUNK_STEPS
from labdrive_sim.thermometer import Thermometer

STILL = {"screw_error": [], "detent": [], "backlash": "0 um", "friction": "0 N*m"}


def recorded(make, motion, sensor, number=1, **others):
    bench = make(STILL, sensor=sensor, **others)
    return bench.record(bench.drive.nominal_table(None), motion, number)


def noise(spindle, motion, sensor):
    """Return time [s] and what the sensor adds to a straight motion [m]."""
    phase, time, value = recorded(spindle, motion, sensor)
    return time, value - value[0] - 1e-3 * phase / TURN


def test_white_noise_is_as_strong_as_set(spindle, motion):
    sensor = {"noise": "0.7 nm", "walk": "0 nm/sqrt(s)"}
    _, added = noise(spindle, motion(periods=64, samples_per_period=256), sensor)
    deviation, samples = np.diff(added) / np.sqrt(2), len(added)
    assert np.std(deviation) == pytest.approx(0.7e-9, rel=6 / np.sqrt(2 * samples))
    assert abs(np.mean(added[1:] * added[:-1]) - np.mean(added) ** 2) < 6 * 0.49e-18 / samples**0.5


@pytest.mark.parametrize("rate_hz", [2.0, 50.0])
def test_a_random_walk_grows_with_the_root_of_time(spindle, motion, rate_hz):
    sensor = {"noise": "0 nm", "walk": "3 nm/sqrt(s)"}
    walk = motion(periods=64, samples_per_period=256, period_rate_hz=rate_hz)
    time, added = noise(spindle, walk, sensor)
    density = np.diff(added) / np.sqrt(np.diff(time))
    assert np.std(density) == pytest.approx(3e-9, rel=6 / np.sqrt(2 * len(time)))
    assert abs(np.corrcoef(density[1:], density[:-1])[0, 1]) < 6 / np.sqrt(len(time))


def test_drift_is_constant(spindle, motion):
    sensor = {"noise": "0 nm", "walk": "0 nm/sqrt(s)", "drift": "5 nm/s"}
    time, added = noise(spindle, motion(), sensor)
    assert added == pytest.approx(5e-9 * (time - time[0]), abs=1e-15)


def test_an_interferometers_own_error_repeats_each_half_wavelength(spindle, motion):
    quiet = {"noise": "0 nm", "walk": "0 nm/sqrt(s)"}
    own = quiet | {"periodic_error": "4 nm", "period": "316 nm"}
    _, _, position = recorded(spindle, motion(), quiet)
    _, _, value = recorded(spindle, motion(), own)
    assert value - position == pytest.approx(4e-9 * np.sin(TURN * position / 316e-9), abs=1e-15)


def test_an_encoder_counts(spindle, motion):
    sensor = {"plugin": "sim-encoder", "resolution": "1.2207 nm", "noise": "0 nm"}
    _, _, position = recorded(spindle, motion(), {"noise": "0 nm", "walk": "0 nm/sqrt(s)"})
    _, _, value = recorded(spindle, motion(), sensor)
    counts = value / 1.2207e-9
    assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert np.max(np.abs(value - position)) <= 1.2207e-9 / 2 * (1 + 1e-6)


def test_an_encoders_subdivisional_error_repeats_each_line_of_the_grating(spindle, motion):
    sensor = {
        "plugin": "sim-encoder",
        "resolution": "1 pm",
        "noise": "0 nm",
        "subdivisional_error": [
            {"order": 1, "amplitude": "20 nm", "phase": "30 deg"},
            {"order": 2, "amplitude": "8 nm"},
        ],
    }
    _, _, position = recorded(spindle, motion(), {"noise": "0 nm", "walk": "0 nm/sqrt(s)"})
    _, _, value = recorded(spindle, motion(), sensor)
    angle = TURN * position / 20e-6
    expected = 20e-9 * np.sin(angle + TURN / 12) + 8e-9 * np.sin(2 * angle)
    assert value - position == pytest.approx(expected, abs=1e-12)


def test_a_force_sensors_noise_is_as_strong_as_set(spindle, motion):
    sensor = {"plugin": "sim-force", "noise": "0.1 N"}
    _, _, force = recorded(spindle, motion(periods=64, samples_per_period=256), sensor)
    assert np.std(force) == pytest.approx(0.1, rel=6 / np.sqrt(2 * len(force)))
    assert abs(np.mean(force)) < 6 * 0.1 / np.sqrt(len(force))


def test_a_thermometer_follows_the_time_of_day(motion, monkeypatch):
    given = {"swing": "0.3 K", "noise": "5 mK"}
    settings = Thermometer.Settings.model_validate(given)
    thermometer = Thermometer(settings, DeviceContext("temperature", Limits()))
    moments, means = np.linspace(0, 1, 10_000), []
    for hour in (0, 6, 12, 18):
        monkeypatch.setattr("time.time", lambda hour=hour: 86400 * 20_000 + 3600 * hour)
        thermometer.arm(Acquisition(1, motion()))
        reading = thermometer.read(Samples(TURN * moments, moments)).value
        means.append(np.mean(reading))
        assert np.std(reading) == pytest.approx(5e-3, rel=0.05)
        assert thermometer.read_at_rest() == pytest.approx(means[-1], abs=1e-3)
    assert means == pytest.approx([293.15, 293.45, 293.15, 292.85], abs=1e-3)


@pytest.mark.parametrize("plugin", ["sim-interferometer", "sim-encoder", "sim-force"])
def test_a_recording_made_again_is_the_same_and_no_other_is(spindle, motion, plugin):
    def once(**changes):
        return recorded(spindle, motion(), {"plugin": plugin}, **changes)[2]

    assert np.array_equal(once(), once())
    assert not np.array_equal(once(), once(number=2))
    assert not np.array_equal(once(), once(seed=1))


@pytest.mark.parametrize("sampling", ["triggered", "polled"])
def test_readings_do_not_depend_on_how_the_motion_is_chunked(spindle, motion, sampling):
    sensor = {"noise": "1 nm", "walk": "2 nm/sqrt(s)", "sampling": sampling}
    sensor |= {"poll_rate": "300 Hz"} if sampling == "polled" else {}
    whole = spindle(sensor=sensor)
    pieces = spindle(sensor=sensor, actuator={"speed": 5})
    walk = motion(periods=12, samples_per_period=16, period_rate_hz=10.0)
    chunks = []
    for bench in (whole, pieces):
        bench.drive.load(bench.drive.nominal_table(None))
        chunks.append([reading for _, reading in bench.play(walk)])
    assert len(chunks[1]) > len(chunks[0])
    times, values = (
        [np.concatenate([getattr(reading, name) for reading in part]) for part in chunks]
        for name in ("time", "value")
    )
    assert np.array_equal(*times)
    assert np.array_equal(*values)


def test_triggered_readings_come_one_a_sample(walking, motion):
    bench = walking()
    bench.drive.load(bench.table())
    for samples, reading in bench.play(motion()):
        assert np.array_equal(samples.time, reading.time)
        assert len(reading.value) == len(samples.phase)


def test_polled_readings_have_times_of_their_own_at_the_rate_set(spindle, motion):
    sensor = {"sampling": "polled", "poll_rate": "777 Hz", "jitter": 0.6}
    bench = spindle(STILL, sensor=sensor)
    bench.drive.load(bench.drive.nominal_table(None))
    walk = motion(periods=20, samples_per_period=16)
    time = np.concatenate([reading.time for _, reading in bench.play(walk)])
    ticks = time * 777
    assert np.array_equal(np.floor(ticks), np.arange(len(time)))
    assert len(time) == pytest.approx(777 * walk.duration_s, abs=1)
    late = ticks % 1
    assert late.max() < 0.6
    assert np.mean(late) == pytest.approx(0.3, abs=0.02)


def test_polled_positions_belong_to_their_times(spindle, motion):
    quiet = {"noise": "0 nm", "walk": "0 nm/sqrt(s)"}
    bench = spindle(STILL, sensor=quiet | {"sampling": "polled", "poll_rate": "5 kHz"})
    bench.drive.load(bench.drive.nominal_table(None))
    # So many cycles that readings fall between the chunks.
    walk = motion(periods=3 * FAST_CHUNK_STEPS // 4096, samples_per_period=16)
    readings = [reading for _, reading in bench.play(walk)]
    assert len(readings) >= 3
    time = np.concatenate([reading.time for reading in readings])
    value = np.concatenate([reading.value for reading in readings])
    assert value == pytest.approx(1e-3 * walk.period_rate_hz * time, abs=1e-12)


def test_sensors_say_how_they_can_be_read(spindle):
    polled = spindle(sensor={"sampling": "polled"}).probe
    assert polled.samplings == {Sampling.POLLED}
    for plugin, unit in (("sim-interferometer", "m"), ("sim-encoder", "m"), ("sim-force", "N")):
        probe = spindle(sensor={"plugin": plugin}).probe
        assert probe.samplings == {Sampling.TRIGGERED}
        assert probe.unit == unit
