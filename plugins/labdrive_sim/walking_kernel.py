"""The compiled loop of the walking drive, a step an entry of the waveform table.

One function, because what it works on lives in registers; `walking_drive` says where the
parameters come from. Lengths are in um, forces in N, voltages in V, time in s.
"""

import numba
import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive_sim.walking_model import Parameters, State

LEGS = 4
SOLVER_STEPS = 60
SOLVED_UM = 1e-10


@numba.njit(cache=True, error_model="numpy")
def walk(p: Parameters, s: State, outputs: FloatArray, step_s: float) -> FloatArray:  # noqa: C901, PLR0912, PLR0915
    """Return the rod's position [um] after each of `outputs` [V], shape (steps, 4).

    Each is held for `step_s`. The state moves on. Normal and tangential forces are in balance at
    the end of each step; both balances are piecewise linear and monotone, so solved exactly.
    """
    steps, plays, creeps = outputs.shape[0], p.radii.shape[0], p.creep_s.shape[0]
    positions = np.empty(steps)
    follow = 1.0 if p.amplifier_s == 0.0 else 1.0 - np.exp(-step_s / p.amplifier_s)
    creeping = 1.0 - np.exp(-step_s / p.creep_s)
    x, y, hold, order = np.empty(LEGS), np.empty(LEGS), np.empty(LEGS), np.empty(LEGS)
    nodes = p.roughness.shape[1]
    drag = p.viscosity / step_s
    for i in range(steps):
        for c in range(4):
            u = s.voltages[c] + follow * (outputs[i, c] - s.voltages[c])
            s.voltages[c] = u
            for j in range(plays):
                s.plays[c, j] = max(u - p.radii[j], min(u + p.radii[j], s.plays[c, j]))
            for j in range(creeps):
                s.creeps[c, j] += creeping[j] * (u - s.creeps[c, j])
        place = s.rod[0] / p.surface_pitch
        node = int(np.floor(place))
        share, first = place - node, node % nodes
        second = (first + 1) % nodes
        for n in range(LEGS):
            c = 2 * (n // 2)
            h0, h1 = s.voltages[c], s.voltages[c + 1]
            for j in range(creeps):
                h0 += p.creep_share * s.creeps[c, j]
                h1 += p.creep_share * s.creeps[c + 1, j]
            for j in range(plays):
                h0 += p.weights[2 * n, j] * s.plays[c, j]
                h1 += p.weights[2 * n + 1, j] * s.plays[c + 1, j]
            h0 *= p.gains[2 * n]
            h1 *= p.gains[2 * n + 1]
            x[n] = p.x_per_volt[n] * (h0 - h1)
            y[n] = p.y_per_volt[n] * (h0 + h1) + p.heights[n]
            rough, spread = p.roughness[n], p.friction_spread[n]
            y[n] += rough[first] + share * (rough[second] - rough[first])
            hold[n] = p.friction * (1 + spread[first] + share * (spread[second] - spread[first]))
        # Legs touch from the highest down, until the rod stands above the next one.
        for n in range(LEGS):
            m = n
            while m > 0 and order[m - 1] < y[n]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = y[n]
        total, z = 0.0, 0.0
        for n in range(LEGS):
            total += p.normal_stiffness * order[n]
            z = (total - p.preload) / ((n + 1) * p.normal_stiffness + p.spring)
            if n == LEGS - 1 or order[n + 1] <= z:
                break
        for n in range(LEGS):
            hold[n] *= p.normal_stiffness * max(y[n] - z, 0.0)
        # The force on the rod falls with its position: Newton's steps, kept inside a bracket.
        before, low, high = s.rod[0], -np.inf, np.inf
        rod = before
        for _ in range(SOLVER_STEPS):
            force, slope = -p.load - drag * (rod - before), drag
            for n in range(LEGS):
                pull = p.tangential_stiffness * (x[n] - rod - s.slips[n])
                if abs(pull) < hold[n]:
                    slope += p.tangential_stiffness
                force += max(-hold[n], min(hold[n], pull))
            pull = p.guide_stiffness * (rod - s.rod[1])
            if abs(pull) < p.guide_friction:
                slope += p.guide_stiffness
            force -= max(-p.guide_friction, min(p.guide_friction, pull))
            if force > 0.0:
                low = rod
            else:
                high = rod
            step = force / slope
            rod += step
            if abs(step) < SOLVED_UM:
                break
            if not low <= rod <= high:
                rod = 0.5 * (low + high)
        for n in range(LEGS):
            pull = p.tangential_stiffness * (x[n] - rod - s.slips[n])
            held = max(-hold[n], min(hold[n], pull))
            s.slips[n] = x[n] - rod - held / p.tangential_stiffness
        pull = p.guide_stiffness * (rod - s.rod[1])
        held = max(-p.guide_friction, min(p.guide_friction, pull))
        s.rod[1] = rod - held / p.guide_stiffness
        s.rod[0] = rod
        positions[i] = rod
    return positions
