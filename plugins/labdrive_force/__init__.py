"""Forces on a bench: weights that a person places."""

from collections.abc import Mapping

from labdrive.interfaces import hookimpl
from labdrive.interfaces.devices import Load
from labdrive_force.weights import WeightsByHand


@hookimpl
def labdrive_loads() -> Mapping[str, type[Load]]:
    """Return the loads."""
    return {"weights-by-hand": WeightsByHand}
