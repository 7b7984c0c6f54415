"""The walking drive, compiled: a step an entry of the waveform table.

`walking_reference` is the same model, written to be read. This module imports numba, so it is
imported when something is about to move and not before.
"""

import numba
import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive_sim.walking_model import CHANNELS, ELEMENTS, LEGS, Parameters, State

MOST_SOLVER_STEPS = 100
SOLVED_UM = 1e-10

compiled = numba.njit(cache=True, error_model="numpy")


@compiled
def walk(
    p: Parameters, s: State, outputs: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return where the rod is [um] and the force on it [N] after each of `outputs` [V].

    `outputs`, shape (steps, 4), are held for `step_s` each; the state moves on. The force is what
    all legs together exert along the travel. No more than a step's arrays live beside the results.
    """
    steps = outputs.shape[0]
    position, force = np.empty(steps), np.empty(steps)
    h, x, y, hold = np.empty(ELEMENTS), np.empty(LEGS), np.empty(LEGS), np.empty(LEGS)
    follow = 1.0 if p.amplifier_s == 0.0 else 1.0 - np.exp(-step_s / p.amplifier_s)
    creeping = 1.0 - np.exp(-step_s / p.creep_s)
    drag = p.viscosity / step_s
    for i in range(steps):
        _expand(p, s, outputs[i], follow, creeping, h)
        _place_tips(p, s, h, x, y)
        _press(p, s, y, hold)
        position[i] = _balance(p, s, x, hold, drag)
        force[i] = _stick(p, s, x, hold, position[i])
    return position, force


@compiled
def _expand(  # noqa: PLR0913 a compiled loop passes what it works on
    p: Parameters, s: State, output: FloatArray, follow: float, creeping: FloatArray, h: FloatArray
) -> None:
    """Set the expansion of each element [V], hysteresis and creep included."""
    for c in range(CHANNELS):
        u = s.voltages[c] + follow * (output[c] - s.voltages[c])
        s.voltages[c] = u
        crept = u
        for j in range(len(p.creep_s)):
            s.creeps[c, j] += creeping[j] * (u - s.creeps[c, j])
            crept += p.creep_share * s.creeps[c, j]
        first = 4 * (c // 2) + c % 2
        one, other = crept, crept
        for j in range(len(p.radii)):
            play = max(u - p.radii[j], min(u + p.radii[j], s.plays[c, j]))
            s.plays[c, j] = play
            one += p.weights[first, j] * play
            other += p.weights[first + 2, j] * play
        h[first], h[first + 2] = p.gains[first] * one, p.gains[first + 2] * other


@compiled
def _place_tips(p: Parameters, s: State, h: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """Set where each tip would be if nothing were in its way [um], y above the rod's valleys."""
    node, share = _surface(p, s)
    for n in range(LEGS):
        x[n] = p.x_per_volt[n] * (h[2 * n] - h[2 * n + 1])
        y[n] = p.y_per_volt[n] * (h[2 * n] + h[2 * n + 1]) + p.heights[n]
        y[n] += _between(p.roughness[n], node, share)


@compiled
def _press(p: Parameters, s: State, y: FloatArray, hold: FloatArray) -> None:
    """Set the force along the rod that each leg can hold [N].

    The height z of the rod balances the leaf spring. Legs that are found below it are let go one
    round after another, which can only raise it further.
    """
    z = -np.inf
    for _ in range(LEGS):
        force, stiffness = -p.preload, p.spring
        for n in range(LEGS):
            if y[n] > z:
                force += p.normal_stiffness * y[n]
                stiffness += p.normal_stiffness
        z = force / stiffness
    node, share = _surface(p, s)
    for n in range(LEGS):
        friction = p.friction * (1 + _between(p.friction_spread[n], node, share))
        hold[n] = friction * p.normal_stiffness * max(y[n] - z, 0.0)


@compiled
def _surface(p: Parameters, s: State) -> tuple[int, float]:
    """Return the node of the surface behind the rod's position and how far beyond it is."""
    place = s.rod[0] / p.surface_pitch
    whole = np.floor(place)
    return int(whole) % p.roughness.shape[1], place - whole


@compiled
def _between(profile: FloatArray, node: int, share: float) -> float:
    """Return a periodic profile between two of its nodes."""
    after = node + 1 if node + 1 < len(profile) else 0
    return profile[node] + share * (profile[after] - profile[node])


@compiled
def _balance(p: Parameters, s: State, x: FloatArray, hold: FloatArray, drag: float) -> float:
    """Return where the forces along the rod are in balance [um].

    The force falls as the rod moves on, in straight pieces: Newton's steps, kept in a bracket.
    """
    before, low, high = s.rod[0], -np.inf, np.inf
    rod = before
    for _ in range(MOST_SOLVER_STEPS):
        force, slope = -p.load - drag * (rod - before), drag
        for n in range(LEGS):
            pull = p.tangential_stiffness * (x[n] - rod - s.slips[n])
            if abs(pull) < hold[n]:
                slope += p.tangential_stiffness
            force += _clipped(pull, hold[n])
        pull = p.guide_stiffness * (rod - s.rod[1])
        if abs(pull) < p.guide_friction:
            slope += p.guide_stiffness
        force -= _clipped(pull, p.guide_friction)
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
    return rod


@compiled
def _stick(p: Parameters, s: State, x: FloatArray, hold: FloatArray, rod: float) -> float:
    """Move the rod there; contacts give way beyond what they hold. Return the legs' force [N]."""
    force = 0.0
    for n in range(LEGS):
        held = _clipped(p.tangential_stiffness * (x[n] - rod - s.slips[n]), hold[n])
        s.slips[n] = x[n] - rod - held / p.tangential_stiffness
        force += held
    held = _clipped(p.guide_stiffness * (rod - s.rod[1]), p.guide_friction)
    s.rod[1] = rod - held / p.guide_stiffness
    s.rod[0] = rod
    return force


@compiled
def _clipped(force: float, most: float) -> float:
    """Return the force [N], no stronger than `most` to either side."""
    return max(-most, min(most, force))
