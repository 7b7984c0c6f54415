"""Find plugins through the entry-point group `labdrive`; one that is broken takes no other down.

pluggy's own entry-point loader drops a second plugin of one name silently and lets an import
error escape, so the loop over entry points is ours.
"""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from pluggy import HookImpl, HookRelay, PluginManager
from pydantic import BaseModel

from labdrive.interfaces import hookspecs
from labdrive.interfaces.plugin_set import BrokenPlugin, PluginSet
from labdrive.model.errors import PluginError, RunInterruptedError

GROUP = "labdrive"
ROLES = (
    *("links", "actuators", "sensors", "loads", "optimizers", "experiments"),
    *("exporters", "notifiers", "trajectories"),
)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PluginHost:
    """The plugins of this environment, and the relay that calls their life-cycle hooks."""

    plugins: PluginSet
    hooks: HookRelay

    def tell(self, hook: str, **values: object) -> None:
        """Call a life-cycle hook of every plugin; what one raises is logged and stops nothing."""
        for impl in getattr(self.hooks, hook).get_hookimpls():
            try:
                impl.function(**{name: values[name] for name in impl.argnames})
            except RunInterruptedError:
                raise
            except (Exception, SystemExit):
                log.exception("plugin %s failed in %s", impl.plugin_name, hook)


def discover(found: list[EntryPoint] | None = None) -> PluginHost:
    """Load every plugin; PluginError if two give one name to different things.

    A plugin that fails to import or to register is put down in `plugins.broken`, by name.
    """
    manager = PluginManager(GROUP)
    manager.add_hookspecs(hookspecs)
    points = found if found is not None else _distinct(entry_points(group=GROUP))
    broken = [problem for point in points if (problem := _register(manager, point))]
    origins = {_plugin_name(point): _distribution(point) for point in points}
    return PluginHost(_collect(manager, origins, broken), manager.hook)


def _distinct(points: Any) -> list[EntryPoint]:
    """Drop what an editable install and its wheel both announce."""
    return list({(p.name, p.value, _distribution(p)): p for p in points}.values())


def _distribution(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown distribution"


def _plugin_name(point: EntryPoint) -> str:
    """Name a plugin for pluggy: two distributions may use one entry-point name."""
    return f"{point.name} of {_distribution(point)}"


def _register(manager: PluginManager, point: EntryPoint) -> BrokenPlugin | None:
    """Import and register one plugin; return what went wrong, if anything did."""
    name = _plugin_name(point)
    try:
        manager.register(point.load(), name=name)
        manager.check_pending()
    except (Exception, SystemExit) as error:  # noqa: BLE001 a plugin may fail in any way and stops nothing else
        if manager.has_plugin(name):
            manager.unregister(name=name)
        return BrokenPlugin(point.name, _distribution(point), f"{type(error).__name__}: {error}")
    return None


def _collect(
    manager: PluginManager, origins: Mapping[str, str], broken: list[BrokenPlugin]
) -> PluginSet:
    roles: dict[str, dict[str, Any]] = {role: {} for role in ROLES}
    origin: dict[tuple[str, str], str] = {}
    for role in ROLES:
        for impl in getattr(manager.hook, f"labdrive_{role}").get_hookimpls():
            source = origins[impl.plugin_name]
            for name, thing in _returned(impl, role, source, broken):
                _refuse_clash(role, name, origin, source)
                roles[role][name] = thing
                origin[role, name] = source
    return PluginSet(**roles, origin=origin, broken=tuple(broken))


def _returned(
    impl: HookImpl, role: str, source: str, broken: list[BrokenPlugin]
) -> Iterator[tuple[str, Any]]:
    """Yield what one registration hook returns, or note why it cannot be used."""
    try:
        found: dict[str, Any] = dict(cast(Mapping[str, Any], impl.function()))
        for name, thing in found.items():
            _refuse_misfit(role, name, thing)
    except (Exception, SystemExit) as error:  # noqa: BLE001 a plugin may fail in any way and stops nothing else
        name = impl.plugin_name.split(" of ")[0]
        broken.append(BrokenPlugin(name, source, f"{type(error).__name__}: {error}"))
        return
    yield from found.items()


def _refuse_misfit(role: str, name: str, thing: Any) -> None:
    """Raise PluginError if this is not what the role takes: a trajectory is a plain function."""
    settings = getattr(thing, "Settings", None)
    if role == "trajectories":
        if not callable(thing):
            raise PluginError(f"{name}: a trajectory is a function of the phase, not {thing!r}")
    elif not (isinstance(settings, type) and issubclass(settings, BaseModel)):
        shown = getattr(thing, "__name__", thing)
        raise PluginError(f"{name}: {shown} carries no pydantic model called Settings")


def _refuse_clash(role: str, name: str, origin: Mapping[tuple[str, str], str], source: str) -> None:
    if (role, name) in origin:
        raise PluginError(
            f"two plugins call themselves {name!r} among the {role}: one of {origin[role, name]}, "
            f"one of {source}. Uninstall one of the two distributions, or have its author rename it"
        )
