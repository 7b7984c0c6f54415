"""The compiled loop of the walking drive, a step an entry of the waveform table.

One function, because what it works on lives in registers; `walking_drive` says where the
parameters come from. Lengths are in um, forces in N, voltages in V, time in s.
"""

from typing import NamedTuple

import numba
import numpy as np

from labdrive.model.arrays import FloatArray

LEGS = 4
SOLVER_STEPS = 60
SOLVED_UM = 1e-10


class Parameters(NamedTuple):
    """Constants of the model. Elements are numbered 2 n and 2 n + 1 for leg n = 0..3."""

    radii: FloatArray
    """Radius r of each play operator [V], shape (plays,)."""
    weights: FloatArray
    """Weight of each play in each element, shape (8, plays)."""
    gains: FloatArray
    """Gain of each element, shape (8,)."""
    creep_s: FloatArray
    """Time constants of creep [s], shape (creeps,)."""
    creep_share: float
    """Expansion that each time constant adds, as a share."""
    amplifier_s: float
    """Time constant of the amplifiers [s]."""
    x_per_volt: FloatArray
    """Tip along the travel against h0 - h1 [um/V], shape (4,)."""
    y_per_volt: FloatArray
    """Tip towards the rod against h0 + h1 [um/V], shape (4,)."""
    heights: FloatArray
    """Height of each leg [um], shape (4,)."""
    preload: float
    """Force of the leaf spring at z = 0 [N]."""
    spring: float
    """Stiffness of the leaf spring [N/um]."""
    normal_stiffness: float
    """Contact stiffness of a leg across the rod [N/um]."""
    tangential_stiffness: float
    """Contact stiffness of a leg along the rod [N/um]."""
    friction: float
    """Coefficient of friction between leg and rod."""
    guide_friction: float
    """Friction of the guide [N]."""
    guide_stiffness: float
    """Stiffness of the guide's friction before it slides [N/um]."""
    viscosity: float
    """Viscous friction of the guide [N s/um]."""
    load: float
    """External force against forward travel [N]."""
    surface_pitch: float
    """Distance of the nodes of roughness and friction [um]."""
    roughness: FloatArray
    """Height of the rod under each leg at those nodes [um], shape (4, nodes), periodic."""
    friction_spread: FloatArray
    """Relative change of the friction there, shape (4, nodes), periodic."""


class State(NamedTuple):
    """What the drive remembers."""

    voltages: FloatArray
    """Behind the amplifiers [V], shape (4,)."""
    plays: FloatArray
    """Play operators [V], shape (4, plays); the elements of a group see one voltage each."""
    creeps: FloatArray
    """Creep states [V], shape (4, creeps)."""
    slips: FloatArray
    """Where the contact of each leg is stuck, tip minus rod [um], shape (4,)."""
    rod: FloatArray
    """Rod position and where the guide's friction is stuck [um], shape (2,)."""


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
