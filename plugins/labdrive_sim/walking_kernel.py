"""The walking drive, compiled: a step an entry of the waveform table.

`walking_reference` is the same model, written to be read. This module imports numba, so it is
imported when something is about to move and not before.
"""

import numba
import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive_sim.walking_model import CHANNELS, ELEMENTS, LEGS, Parameters, State

MOST_SOLVER_STEPS = 200
SOLVED_UM = 1e-10

# Parts of the loop are merged into it: called, each would count references to every array.
inlined = numba.njit(error_model="numpy", inline="always")


@numba.njit(cache=True, error_model="numpy")
def walk(
    p: Parameters, s: State, outputs: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where the rod is, the force on it and its height after each of `outputs` [V].

    `outputs`, shape (steps, 4), are held for `step_s` each; the state moves on. Position and height
    are in um; the force [N] is what all legs together exert along the travel. No more than a step's
    arrays live beside the results.
    """
    steps = outputs.shape[0]
    position, force, height = np.empty(steps), np.empty(steps), np.empty(steps)
    h, x, y = np.empty(ELEMENTS), np.empty(LEGS), np.empty(LEGS)
    friction, hold = np.empty(LEGS), np.empty(LEGS)
    follow = 1.0 if p.amplifier_s == 0.0 else 1.0 - np.exp(-step_s / p.amplifier_s)
    creeping = 1.0 - np.exp(-step_s / p.creep_s)
    drag = p.viscosity / step_s
    for i in range(steps):
        _expand(p, s, outputs, i, follow, creeping, h)
        _place_tips(p, s, h, x, y, friction)
        height[i] = _press(p, y, friction, hold)
        position[i] = _balance(p, s, x, hold, drag)
        force[i] = _stick(p, s, x, hold, position[i])
    return position, force, height


@inlined
def _expand(  # noqa: PLR0913 a compiled loop passes what it works on
    p: Parameters,
    s: State,
    outputs: FloatArray,
    i: int,
    follow: float,
    creeping: FloatArray,
    h: FloatArray,
) -> None:
    """Set the expansion of each element [V], hysteresis and creep included."""
    for c in range(CHANNELS):
        u = s.voltages[c] + follow * (outputs[i, c] - s.voltages[c])
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


@inlined
def _place_tips(  # noqa: PLR0913 as above
    p: Parameters, s: State, h: FloatArray, x: FloatArray, y: FloatArray, friction: FloatArray
) -> None:
    """Set where each tip would be with nothing in its way [um], and its coefficient of friction."""
    place = s.rod[0] / p.surface_pitch
    whole = np.floor(place)
    node, share = int(whole) % p.roughness.shape[1], place - whole
    for n in range(LEGS):
        x[n] = p.x_per_volt[n] * (h[2 * n] - h[2 * n + 1])
        y[n] = p.y_per_volt[n] * (h[2 * n] + h[2 * n + 1]) + p.heights[n]
        y[n] += _between(p.roughness, n, node, share)
        friction[n] = p.friction * (1 + _between(p.friction_spread, n, node, share))


@inlined
def _press(p: Parameters, y: FloatArray, friction: FloatArray, hold: FloatArray) -> float:
    """Set the force along the rod that each leg can hold [N]; return the rod's height [um].

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
    for n in range(LEGS):
        hold[n] = friction[n] * p.normal_stiffness * max(y[n] - z, 0.0)
    return z


@inlined
def _between(profiles: FloatArray, leg: int, node: int, share: float) -> float:
    """Return a leg's periodic profile between two of its nodes."""
    after = node + 1 if node + 1 < profiles.shape[1] else 0
    near: float = profiles[leg, node]
    far: float = profiles[leg, after]
    return near + share * (far - near)


@inlined
def _balance(p: Parameters, s: State, x: FloatArray, hold: FloatArray, drag: float) -> float:
    """Return where the forces along the rod are in balance [um].

    The force falls as the rod moves on, in straight pieces. Newton's step is exact where it stays
    on a piece; steps that leave the bracket, or would come back to its ends, halve it instead.
    """
    low, high, before = -np.inf, np.inf, -1
    rod: float = s.rod[0]
    for _ in range(MOST_SOLVER_STEPS):
        force, slope, piece = _pull(p, s, x, hold, rod)
        force -= p.load + drag * (rod - s.rod[0])
        root = rod + force / (slope + drag)
        if force > 0.0:
            low = rod
        else:
            high = rod
        if piece == before or root == rod or high - low < SOLVED_UM:
            break
        if low < root < high:
            rod, before = root, piece
        else:
            rod, before = 0.5 * (low + high), -1
    return rod


@inlined
def _pull(
    p: Parameters, s: State, x: FloatArray, hold: FloatArray, rod: float
) -> tuple[float, float, int]:
    """Return the force of legs and guide on the rod [N], how it falls [N/um], and on which piece.

    The number of a piece says which contacts stick and which slide to either side.
    """
    force, slope, piece = 0.0, 0.0, 0
    for n in range(LEGS + 1):
        if n < LEGS:
            stiffness, most, relaxed = p.tangential_stiffness, hold[n], x[n] - s.slips[n]
        else:
            stiffness, most, relaxed = p.guide_stiffness, p.guide_friction, s.rod[1]
        if most > 0.0:
            pull = stiffness * (relaxed - rod)
            side = int(pull >= most) - int(pull <= -most)
            force += side * most if side else pull
            slope += 0.0 if side else stiffness
            piece = 3 * piece + side + 1
    return force, slope, piece


@inlined
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


@inlined
def _clipped(force: float, most: float) -> float:
    """Return the force [N], no stronger than `most` to either side."""
    return max(-most, min(most, force))
