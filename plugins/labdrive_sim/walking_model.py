"""What the walking drive is made of and what it remembers, as its loops take it.

Lengths are in um, forces in N, voltages in V, time in s. Leg n = 0..3 belongs to group n // 2 and
has the elements 2 n and 2 n + 1, which the channels 2 (n // 2) and 2 (n // 2) + 1 drive.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from labdrive.model.arrays import FloatArray

LEGS = 4
CHANNELS = 4
ELEMENTS = 8


class Parameters(NamedTuple):
    """Constants of the model."""

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
    """What the drive remembers; whoever walks it changes the arrays in place."""

    voltages: FloatArray
    """Behind the amplifiers [V], shape (4,)."""
    plays: FloatArray
    """Play operators [V], shape (4, plays): the elements on a channel share its voltage."""
    creeps: FloatArray
    """Creep states [V], shape (4, creeps)."""
    slips: FloatArray
    """Tip minus rod where the contact of each leg is relaxed [um], shape (4,)."""
    rod: FloatArray
    """Where the rod is and where the guide's friction is relaxed [um], shape (2,)."""


Walk = Callable[[Parameters, State, FloatArray, float], tuple[FloatArray, FloatArray, FloatArray]]
"""A loop over outputs [V], shape (steps, 4), each held for so long [s].

It returns where the rod is [um], the force of all legs on it [N] and how high it is held [um] after
each step, and moves the state on.
"""


def at_rest(plays: int, creeps: int) -> State:
    """Return the state of a drive that has never been moved, all voltages 0."""
    return State(
        voltages=np.zeros(CHANNELS),
        plays=np.zeros((CHANNELS, plays)),
        creeps=np.zeros((CHANNELS, creeps)),
        slips=np.zeros(LEGS),
        rod=np.zeros(2),
    )
