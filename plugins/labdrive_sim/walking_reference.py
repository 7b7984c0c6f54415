"""The model of the walking drive, written to be read: what the compiled loop is tested against.

A step is an entry of the waveform table. Within it everything comes to rest: there is no mass.
Elements expand with hysteresis; the rod finds the height at which the legs balance the leaf
spring, then the place at which they balance the load and the guide.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive_sim.walking_model import CHANNELS, LEGS, Parameters, State


def walk(
    p: Parameters, s: State, outputs: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where the rod is [um], the legs' force on it [N] and its height [um] after each step.

    `outputs` [V], shape (steps, 4), are held for `step_s` each; the state moves on.
    """
    results = [_step(p, s, [float(u) for u in output], step_s) for output in outputs]
    position, force, height = np.array(results).reshape(-1, 3).T
    return position, force, height


def _step(
    p: Parameters, s: State, output: Sequence[float], step_s: float
) -> tuple[float, float, float]:
    for channel in range(CHANNELS):
        _drive(p, s, channel, output[channel], step_s)
    tips = [_tip(p, s, leg) for leg in range(LEGS)]
    z = _rod_height(p, [y for _, y in tips])
    holds = _holds(p, s, [y - z for _, y in tips])
    pulls = [
        _bristle(x - s.slips[leg], p.tangential_stiffness, hold)
        for leg, ((x, _), hold) in enumerate(zip(tips, holds, strict=True))
    ]
    guide = _bristle(s.rod[1], p.guide_stiffness, p.guide_friction)
    rod = _balance(p, float(s.rod[0]), step_s, [*pulls, guide])
    for leg, (x, _) in enumerate(tips):
        s.slips[leg] = x - rod - pulls[leg][0](rod) / p.tangential_stiffness
    s.rod[:] = rod, rod + guide[0](rod) / p.guide_stiffness
    return rod, sum(pull(rod) for pull, _ in pulls), z


def _drive(p: Parameters, s: State, channel: int, output: float, step_s: float) -> None:
    """Charge the amplifier; let the plays be dragged along and the creep follow."""
    lag = math.exp(-step_s / p.amplifier_s) if p.amplifier_s else 0.0
    u = output + lag * (s.voltages[channel] - output)
    s.voltages[channel] = u
    for j, radius in enumerate(p.radii):
        s.plays[channel, j] = _clipped(s.plays[channel, j], u - radius, u + radius)
    for j, time_s in enumerate(p.creep_s):
        s.creeps[channel, j] = u + math.exp(-step_s / time_s) * (s.creeps[channel, j] - u)


def _tip(p: Parameters, s: State, leg: int) -> tuple[float, float]:
    """Return where the tip would be with nothing in its way: x along, y across the rod [um]."""
    h0, h1 = (_expansion(p, s, 2 * leg + i, 2 * (leg // 2) + i) for i in (0, 1))
    y = p.y_per_volt[leg] * (h0 + h1) + p.heights[leg] + _under_leg(p, s, p.roughness[leg])
    return p.x_per_volt[leg] * (h0 - h1), y


def _expansion(p: Parameters, s: State, element: int, channel: int) -> float:
    """Return h = gain (U + sum of w play_r(U) + creep) [V]."""
    hysteresis = sum(w * play for w, play in zip(p.weights[element], s.plays[channel], strict=True))
    creep = p.creep_share * sum(s.creeps[channel])
    return float(p.gains[element] * (s.voltages[channel] + hysteresis + creep))


def _under_leg(p: Parameters, s: State, profile: FloatArray) -> float:
    """Return a property of the rod's surface, linear between its nodes, where the rod was."""
    place = s.rod[0] / p.surface_pitch
    node = math.floor(place)
    near, far = profile[node % len(profile)], profile[(node + 1) % len(profile)]
    return float(near + (place - node) * (far - near))


def _holds(p: Parameters, s: State, dents: Sequence[float]) -> list[float]:
    """Return the force along the rod that each leg can hold [N]: mu k_n (y - z)+."""
    normal = [p.normal_stiffness * max(dent, 0.0) for dent in dents]
    friction = [p.friction * (1 + _under_leg(p, s, spread)) for spread in p.friction_spread]
    return [mu * force for mu, force in zip(friction, normal, strict=True)]


def _rod_height(p: Parameters, heights: Sequence[float]) -> float:
    """Return z [um], highest of those that the highest one, two, ... legs would hold it at.

    A leg too many pulls the rod down and one too few lets it sink, so z is highest where right.
    """
    return max(_held_by(p, sorted(heights)[-count:]) for count in range(1, LEGS + 1))


def _held_by(p: Parameters, touching: Sequence[float]) -> float:
    """Return z with sum k_n (y - z) = preload + spring z over the legs that touch [um]."""
    stiffness = len(touching) * p.normal_stiffness + p.spring
    return (p.normal_stiffness * sum(touching) - p.preload) / stiffness


Bristle = tuple[Callable[[float], float], tuple[float, float]]
"""A force [N] that falls with the rod's position, and the positions [um] between which it does."""


def _bristle(relaxed: float, stiffness: float, most: float) -> Bristle:
    """Return a spring that is relaxed with the rod at `relaxed` and slides beyond `most` [N]."""
    reach = most / stiffness
    return lambda rod: _clipped(stiffness * (relaxed - rod), -most, most), (
        relaxed - reach,
        relaxed + reach,
    )


def _balance(p: Parameters, before: float, step_s: float, bristles: Sequence[Bristle]) -> float:
    """Return where bristles, load and viscosity are in balance [um].

    The force falls along straight pieces that meet where a bristle starts or ceases to slide.
    """

    def force(rod: float) -> float:
        dragged = p.load + p.viscosity * (rod - before) / step_s
        return sum(pull(rod) for pull, _ in bristles) - dragged

    corners = sorted(corner for _, ends in bristles for corner in ends)
    ahead = [corner for corner in corners if force(corner) <= 0]
    behind = [corner for corner in corners if force(corner) > 0]
    left = behind[-1] if behind else ahead[0] - 1
    right = ahead[0] if ahead else behind[-1] + 1
    at_left, at_right = force(left), force(right)
    return left + (right - left) * at_left / (at_left - at_right)


def _clipped(value: float, low: float, high: float) -> float:
    return max(low, min(high, value))
