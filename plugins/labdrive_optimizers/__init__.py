"""Optimizers that ship with labdrive."""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.optimizer import Optimizer
from labdrive_optimizers.fourier import FourierOptimizer


@hookimpl
def labdrive_optimizers() -> Mapping[str, type[Optimizer]]:
    """Return the optimizers by the name that recipes use."""
    return {"fourier": FourierOptimizer}
