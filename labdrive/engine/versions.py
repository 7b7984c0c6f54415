"""Versions of everything that has a part in a result."""

import platform
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

from labdrive.interfaces.plugin_set import PluginSet


def versions(plugins: PluginSet) -> dict[str, Any]:
    """Return the versions of labdrive, Python, numpy and each plugin's distribution."""
    names = {f"{role}.{name}": source for (role, name), source in plugins.origin.items()}
    return {
        "labdrive": version("labdrive"),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "plugins": names,
    }


def changed_versions(info: Mapping[str, Any], plugins: PluginSet) -> Iterator[str]:
    """Yield, in words, what has another version now than in a run's run.json."""
    then, now = info.get("versions", {}), versions(plugins)
    for name in ("labdrive", "python", "numpy"):
        if then.get(name) != now[name]:
            yield f"{name} was {then.get(name)}, is {now[name]}"
    for name, source in then.get("plugins", {}).items():
        if now["plugins"].get(name) != source:
            yield f"plugin {name} was of {source}, is of {now['plugins'].get(name, 'nobody')}"
