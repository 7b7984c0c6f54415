"""All that a plugin author reads: devices, optimizers, experiments, settings and hooks."""

from pluggy import HookimplMarker

hookimpl = HookimplMarker("labdrive")

__all__ = ["hookimpl"]
