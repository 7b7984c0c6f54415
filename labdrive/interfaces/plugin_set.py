"""What discovery found: each role's plugins by name, and those that could not be used."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from labdrive.periodic.trajectories import Trajectory


@dataclass(frozen=True)
class BrokenPlugin:
    """A plugin that could not be imported or registered, and why."""

    name: str
    distribution: str
    error: str


@dataclass(frozen=True)
class PluginSet:
    """Classes by name for each role, and trajectories, which are functions.

    `origin` maps (role, name) to a distribution and its version.
    """

    links: Mapping[str, type[Any]] = field(default_factory=dict)
    actuators: Mapping[str, type[Any]] = field(default_factory=dict)
    sensors: Mapping[str, type[Any]] = field(default_factory=dict)
    loads: Mapping[str, type[Any]] = field(default_factory=dict)
    optimizers: Mapping[str, type[Any]] = field(default_factory=dict)
    experiments: Mapping[str, type[Any]] = field(default_factory=dict)
    exporters: Mapping[str, type[Any]] = field(default_factory=dict)
    notifiers: Mapping[str, type[Any]] = field(default_factory=dict)
    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    origin: Mapping[tuple[str, str], str] = field(default_factory=dict)
    broken: tuple[BrokenPlugin, ...] = ()

    def role(self, role: str) -> Mapping[str, type[Any]]:
        """Return the classes of one role: `links`, `actuators`, and so on."""
        classes: Mapping[str, type[Any]] = getattr(self, role)
        return classes
