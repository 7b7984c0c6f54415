"""The kinds of recipe and the trajectories that ship with labdrive, registered like any others."""

from collections.abc import Mapping

from labdrive.experiments.characterize import Characterize
from labdrive.experiments.characterize_spindle import CharacterizeSpindle
from labdrive.experiments.identify_legs import IdentifyLegs
from labdrive.experiments.load_sweep import LoadSweep
from labdrive.experiments.optimize import Optimize
from labdrive.experiments.optimize_drives import OptimizeDrives
from labdrive.experiments.reverse_check import ReverseCheck
from labdrive.experiments.rolling_resistance import RollingResistance
from labdrive.experiments.scaling_sweep import ScalingSweep
from labdrive.interfaces import hookimpl
from labdrive.interfaces.experiment import Experiment
from labdrive.periodic.trajectories import TRAJECTORIES, Trajectory


@hookimpl
def labdrive_experiments() -> Mapping[str, type[Experiment]]:
    """Return the experiments by the name that recipes use."""
    return {
        "characterize": Characterize,
        "characterize_spindle": CharacterizeSpindle,
        "identify_legs": IdentifyLegs,
        "load_sweep": LoadSweep,
        "optimize": Optimize,
        "optimize_drives": OptimizeDrives,
        "reverse_check": ReverseCheck,
        "rolling_resistance": RollingResistance,
        "scaling_sweep": ScalingSweep,
    }


@hookimpl
def labdrive_trajectories() -> Mapping[str, Trajectory]:
    """Return the trajectories of the paper."""
    return TRAJECTORIES
