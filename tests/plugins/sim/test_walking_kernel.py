"""The compiled loop against the model that is written to be read."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from labdrive.periodic.legs import LegModel, walking_table
from labdrive.periodic.trajectories import TRAJECTORIES
from labdrive_sim import walking_kernel, walking_reference
from labdrive_sim.walking_drive import WalkingDrive, parameters
from labdrive_sim.walking_model import at_rest

LEGS = LegModel.bending(0.036e-6, 0.025e-6)
LENGTH = 192
SHAPES = st.sampled_from(sorted(TRAJECTORIES))


def text(unit, low, high):
    return st.floats(low, high, allow_nan=False).map(lambda value: f"{value:.6f} {unit}")


@st.composite
def drives(draw):
    """Draw settings of a drive that its load cannot pull away: where it went would be chance."""
    friction, preload = draw(st.floats(0.05, 1)), draw(st.floats(20, 400))
    load = draw(st.floats(-0.5, 0.5)) * friction * preload
    others = {
        "seed": st.integers(0, 1000),
        "loop_width": st.floats(0, 0.2),
        "plays": st.integers(2, 12),
        "creep": st.sampled_from([0.0, 0.01]),
        "amplifier_time": text("ms", 0, 10),
        "spring": text("N/um", 0, 20),
        "friction_spread": st.floats(0, 0.05),
        "roughness": text("nm", 0, 20),
        "guide_friction": text("N", 0, 5),
        "viscosity": text("N*s/m", 1, 100),
    }
    given_load = {"friction": friction, "preload": f"{preload:.6f} N", "load": f"{load:.6f} N"}
    return draw(st.fixed_dictionaries(others)) | given_load


# Here the balance lies where every leg slides, between two pieces whose roots name each other.
ALL_SLIDE = {
    "loop_width": 0.125,
    "plays": 2,
    "amplifier_time": "0 ms",
    "spring": "0 N/um",
    "friction_spread": 0.0,
    "roughness": "0 nm",
    "guide_friction": "0 N",
    "viscosity": "1 N*s/m",
    "friction": 0.5,
    "preload": "20 N",
    "seed": 0,
}


def walk(loop, drive, outputs, step_s):
    state = at_rest(len(drive.radii), len(drive.creep_s))
    return *loop(drive, state, outputs, step_s), state


@given(drives(), SHAPES, st.floats(0.1, 50))
@example(ALL_SLIDE, "triangle", 1.0)
@settings(max_examples=20, deadline=None)
def test_the_compiled_loop_does_what_the_model_says(given_settings, trajectory, rate_hz):
    drive = parameters(WalkingDrive.Settings.model_validate(given_settings))
    table = walking_table(TRAJECTORIES[trajectory], LEGS, 0, 48, length=LENGTH)
    cycle = np.stack([channel.samples for channel in table.channels], axis=1)
    there_and_back = np.concatenate([cycle, cycle, cycle[::-1], cycle[::-1]])
    step_s = 1 / (rate_hz * LENGTH)
    compiled = walk(walking_kernel.walk, drive, there_and_back, step_s)
    reference = walk(walking_reference.walk, drive, there_and_back, step_s)
    np.testing.assert_allclose(compiled[0], reference[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(compiled[1], reference[1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(compiled[2], reference[2], rtol=0, atol=1e-9)
    for left, right in zip(compiled[3], reference[3], strict=True):
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-9)


def test_a_motion_goes_on_from_where_the_state_is():
    drive = parameters(WalkingDrive.Settings())
    table = walking_table(TRAJECTORIES["ellipse"], LEGS, 0, 48, length=LENGTH)
    outputs = np.stack([channel.samples for channel in table.channels], axis=1)
    *whole, _ = walk(walking_kernel.walk, drive, outputs, 1e-3)
    state = at_rest(len(drive.radii), len(drive.creep_s))
    parts = [
        walking_kernel.walk(drive, state, np.ascontiguousarray(outputs[part]), 1e-3)
        for part in (slice(0, 1), slice(1, 100), slice(100, 100), slice(100, None))
    ]
    for at_once, in_parts in zip(whole, zip(*parts, strict=True), strict=True):
        assert np.array_equal(at_once, np.concatenate(in_parts))
