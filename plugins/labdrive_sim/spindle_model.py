"""What the lead screw and its motor are made of, as the compiled loop takes it. SI units."""

from typing import NamedTuple

from labdrive.model.arrays import FloatArray


class Harmonics(NamedTuple):
    """Sum of amplitude (sin(order angle + phase) - sin(phase)): nothing at angle 0.

    All of shape (harmonics,); orders are cycles a revolution, phases are in rad.
    """

    orders: FloatArray
    amplitudes: FloatArray
    phases: FloatArray


class Parameters(NamedTuple):
    """Constants of the model."""

    lead: float
    """Travel in a revolution [m]."""
    screw_error: Harmonics
    """Travel beyond lead times turns [m]."""
    detent: Harmonics
    """Torque of the detent over the stiffness of the motor [rad]."""
    twist: float
    """What the load turns the motor back by [rad]."""
    wind_up: float
    """Friction torque over the stiffness of the motor [rad]."""
    backlash: float
    """Play of the nut from flank to flank [m]."""
