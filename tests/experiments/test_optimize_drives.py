"""Two drives of one bench, one after the other and together."""

import pytest

QUICK = ("motion.periods=8", "stop.max_iterations=2")
SHARE = 0.002
"""What each beam of the shipped bench sees of the other axis; the second with the other sign."""


@pytest.mark.parametrize("order", ["one_after_the_other", "together"])
def test_both_drives_come_to_their_noise_floors(ran, order):
    result = ran("optimize_drives.yaml", *QUICK, f"order={order}").result
    assert [drive["actuator"] for drive in result["drives"]] == ["x", "y"]
    for drive in result["drives"]:
        assert drive["improvement"] > 50
        after = drive["verification"]["periodic_error"]["rms"]
        assert after < 2.5 * drive["verification"]["noise_floor"]["rms"]


def test_together_takes_fewer_recordings(ran):
    counts = []
    for order in ("one_after_the_other", "together"):
        done = ran("optimize_drives.yaml", *QUICK, f"order={order}")
        counts.append(len(list(done.outcome.folder.glob("recordings/*.h5"))))
    assert counts[1] < counts[0]


def test_the_cross_talk_is_what_each_sensor_sees_of_the_other_drive(ran):
    result = ran("optimize_drives.yaml", *QUICK).result
    shares = {(c["moved"], c["sensor"]): c for c in result["cross_talk"]}
    assert shares["x", "along_x"]["share"] == 1
    for pair, true in ((("y", "along_x"), SHARE), (("x", "along_y"), -SHARE)):
        found = shares[pair]
        assert found["share"] == pytest.approx(true, abs=6 * found["share_standard_error"])
        assert found["share_standard_error"] < 0.05 * SHARE


def test_the_same_drive_twice_is_refused(ran):
    drive = "{actuator: x, sensor: along_x, waveform: {trajectory: box}}"
    with pytest.raises(Exception, match="drives: must name every actuator once"):
        ran("optimize_drives.yaml", f"drives=[{drive}, {drive}]")


def test_a_wrong_waveform_is_told_at_its_drive(ran):
    good = "{actuator: x, sensor: along_x, waveform: {trajectory: box}}"
    bad = "{actuator: y, sensor: along_y, waveform: {trajectory: box, amplitude: 90 V}}"
    with pytest.raises(Exception, match=r"drives\.1\.waveform\.amplitude: .*90 V"):
        ran("optimize_drives.yaml", f"drives=[{good}, {bad}]")
