"""Every hook, on one screen. Implement those you need, with `labdrive.interfaces.hookimpl`.

The registration hooks are called once, after a plugin's module is imported, and again by nobody:
return a mapping from the name that recipes and benches use to a class that carries a pydantic
`Settings`. Do not touch devices, files or the network in them.

The life-cycle hooks are called in the run's process between motions. They must return quickly and
must not move anything; what they raise is logged and does not stop the run.
"""

from collections.abc import Mapping
from pathlib import Path

from pluggy import HookspecMarker

from labdrive.interfaces.devices import Actuator, Link, Load, Sensor
from labdrive.interfaces.experiment import Experiment
from labdrive.interfaces.optimizer import Optimizer
from labdrive.model.recording import Recording
from labdrive.periodic.trajectories import Trajectory

hookspec = HookspecMarker("labdrive")


@hookspec
def labdrive_links() -> Mapping[str, type[Link]]:  # type: ignore[empty-body]
    """Return connections that several devices share: an FPGA session, a bus, a simulated plant."""


@hookspec
def labdrive_actuators() -> Mapping[str, type[Actuator]]:  # type: ignore[empty-body]
    """Return actuators."""


@hookspec
def labdrive_sensors() -> Mapping[str, type[Sensor]]:  # type: ignore[empty-body]
    """Return sensors."""


@hookspec
def labdrive_loads() -> Mapping[str, type[Load]]:  # type: ignore[empty-body]
    """Return what can put an external force on an actuator."""


@hookspec
def labdrive_trajectories() -> Mapping[str, Trajectory]:  # type: ignore[empty-body]
    """Return trajectories of a leg's tip: pure functions of the phase, with no settings."""


@hookspec
def labdrive_optimizers() -> Mapping[str, type[Optimizer]]:  # type: ignore[empty-body]
    """Return optimizers."""


@hookspec
def labdrive_experiments() -> Mapping[str, type[Experiment]]:  # type: ignore[empty-body]
    """Return experiments: the `kind` of a recipe."""


@hookspec
def labdrive_exporters() -> Mapping[str, type]:  # type: ignore[empty-body]
    """Return exporters: the formats of `labdrive export`."""


@hookspec
def labdrive_notifiers() -> Mapping[str, type]:  # type: ignore[empty-body]
    """Return notifiers: where schedules send word."""


@hookspec
def labdrive_run_started(run: Path) -> None:
    """Be told that a run has its folder; nothing is connected yet."""


@hookspec
def labdrive_recorded(run: Path, recording: Recording) -> None:
    """Be told that a recording is on disk; it must not be changed."""


@hookspec
def labdrive_run_ended(run: Path, status: str) -> None:
    """Be told that a run is over, its devices safe and its result written."""
