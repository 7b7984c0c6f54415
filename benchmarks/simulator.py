"""How many steps a second the simulated walking drive makes, compiled and as a plain loop."""

import argparse
import time
from itertools import repeat

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.periodic.legs import LegModel, walking_table
from labdrive.periodic.trajectories import TRAJECTORIES
from labdrive_sim import walking_kernel, walking_reference
from labdrive_sim.walking_drive import WalkingDrive, parameters
from labdrive_sim.walking_model import Walk, at_rest

REPEATS = 5


def cycles(trajectory: str, count: int) -> FloatArray:
    """Return the voltages [V] of so many cycles, shape (steps, 4)."""
    table = walking_table(TRAJECTORIES[trajectory], LegModel.bending(0.036e-6, 0.025e-6), 0, 48)
    cycle = np.stack([channel.samples for channel in table.channels], axis=1)
    return np.concatenate(list(repeat(cycle, count)))


def steps_per_second(walk: Walk, outputs: FloatArray) -> float:
    """Return the rate of the fastest of several walks: the one least disturbed."""
    return max(_rate(walk, outputs) for _ in range(REPEATS))


def _rate(walk: Walk, outputs: FloatArray) -> float:
    drive = parameters(WalkingDrive.Settings())
    state = at_rest(len(drive.radii), len(drive.creep_s))
    start = time.perf_counter()
    walk(drive, state, outputs, 1 / 4096)
    return len(outputs) / (time.perf_counter() - start)


def main() -> None:
    """Print one line for each waveform."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=500, help="of the compiled loop")
    options = parser.parse_args()
    for trajectory in ("ellipse", "triangle", "box"):
        compiled = steps_per_second(walking_kernel.walk, cycles(trajectory, options.cycles))
        plain = steps_per_second(walking_reference.walk, cycles(trajectory, 1))
        print(
            f"{trajectory:8s}: {compiled / 1e6:.2f} million steps/s compiled, "
            f"{plain / 1e3:.1f} thousand in plain Python, ratio {compiled / plain:.0f}"
        )


if __name__ == "__main__":
    main()
