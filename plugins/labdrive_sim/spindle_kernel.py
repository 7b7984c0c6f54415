"""The lead screw, compiled: a step an entry of the table.

This module imports numba, so it is imported when something is about to move and not before.
"""

import math

import numba
import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive_sim.spindle_model import Harmonics, Parameters

MOST_SOLVER_STEPS = 50
SOLVED_RAD = 1e-11

inlined = numba.njit(error_model="numpy", inline="always")


@numba.njit(cache=True, error_model="numpy")
def turn(p: Parameters, plays: FloatArray, commanded: FloatArray) -> FloatArray:
    """Return where the nut is [m] for each commanded angle [rad], shape (steps,).

    `plays`, shape (3,), are the screw's angle [rad], the nut's place [m] and the motor's angle
    [rad]; they move on.
    """
    position = np.empty(len(commanded))
    screw, nut, motor = plays
    for i in range(len(commanded)):
        motor = _motor_angle(p, commanded[i])
        screw = max(motor - p.wind_up, min(motor + p.wind_up, screw))
        flank = p.lead * screw / (2 * math.pi) + _sum(p.screw_error, screw)
        nut = max(flank - p.backlash / 2, min(flank + p.backlash / 2, nut))
        position[i] = nut
    plays[0], plays[1], plays[2] = screw, nut, motor
    return position


@inlined
def _motor_angle(p: Parameters, commanded: float) -> float:
    """Return where stiffness times (commanded - angle) balances detent and load [rad].

    Newton's step; one that leaves the bracket, as a steep detent makes it, halves that instead.
    """
    angle = commanded - p.twist
    reach = 2 * np.sum(np.abs(p.detent.amplitudes))
    low, high = angle - reach, angle + reach
    for _ in range(MOST_SOLVER_STEPS):
        excess = commanded - p.twist - angle - _sum(p.detent, angle)
        if excess > 0.0:
            low = angle
        else:
            high = angle
        better = angle + excess / (1 + _slope(p.detent, angle))
        if not low <= better <= high:
            better = 0.5 * (low + high)
        step, angle = better - angle, better
        if abs(step) < SOLVED_RAD:
            break
    return angle


@inlined
def _sum(h: Harmonics, angle: float) -> float:
    value = 0.0
    for k in range(len(h.orders)):
        turned = math.sin(h.orders[k] * angle + h.phases[k]) - math.sin(h.phases[k])
        value += h.amplitudes[k] * turned
    return value


@inlined
def _slope(h: Harmonics, angle: float) -> float:
    slope = 0.0
    for k in range(len(h.orders)):
        slope += h.amplitudes[k] * h.orders[k] * math.cos(h.orders[k] * angle + h.phases[k])
    return slope
