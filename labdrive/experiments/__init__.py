"""The kinds of recipe and the trajectories that ship with labdrive, registered like any others."""

from collections.abc import Mapping

from labdrive.experiments.characterize import Characterize
from labdrive.experiments.optimize import Optimize
from labdrive.interfaces import hookimpl
from labdrive.interfaces.experiment import Experiment
from labdrive.periodic.trajectories import TRAJECTORIES, Trajectory


@hookimpl
def labdrive_experiments() -> Mapping[str, type[Experiment]]:
    """Return the experiments by the name that recipes use."""
    return {"characterize": Characterize, "optimize": Optimize}


@hookimpl
def labdrive_trajectories() -> Mapping[str, Trajectory]:
    """Return the trajectories of the paper."""
    return TRAJECTORIES
