"""The kinds of recipe that ship with labdrive, registered like anybody else's."""

from collections.abc import Mapping

from labdrive.experiments.characterize import Characterize
from labdrive.experiments.optimize import Optimize
from labdrive.interfaces import hookimpl
from labdrive.interfaces.experiment import Experiment


@hookimpl
def labdrive_experiments() -> Mapping[str, type[Experiment]]:
    """Return the experiments by the name that recipes use."""
    return {"characterize": Characterize, "optimize": Optimize}
