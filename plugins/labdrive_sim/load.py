"""A simulated load on a walking drive: a weight, or a friction pair as on the paper's bench."""

from typing import Literal, Protocol, cast

from pydantic import Field

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import InputError, Problem


class Loadable(Protocol):
    """A plant that can bear a load."""

    def bear(self, *, weight: float = 0.0, friction: float = 0.0) -> None:
        """Pull against forward travel with `weight` [N], against any travel with `friction`."""


class SimLoad:
    """Loads a plant. A friction pair only resists; a weight also pulls back what lets go of it."""

    class Settings(SettingsBase):
        """Settings of the load."""

        link: str = Field(description="The bench's plant that bears the load.")
        kind: Literal["friction_pair", "weight"] = Field(
            default="friction_pair",
            description="friction_pair: against the travel, whichever way. weight: against forward "
            "travel, always; beyond what the legs hold it runs away with the rod.",
        )

    needs_person = False

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._kind = settings.kind
        plant = context.links.get(settings.link)
        if not hasattr(plant, "bear"):
            found = [name for name, other in context.links.items() if hasattr(other, "bear")]
            message = f"must name a plant that bears loads; the bench has {', '.join(found) or 0}"
            raise InputError(Problem(message, "load.link", got=settings.link))
        self._plant = cast("Loadable", plant)

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def apply(self, force: float) -> float:
        """Load the plant with `force` [N]."""
        if self._kind == "weight":
            self._plant.bear(weight=force)
        else:
            self._plant.bear(friction=force)
        return force

    def relive(self, force: float) -> None:
        """Load the plant as an earlier process had."""
        self.apply(force)

    def make_safe(self) -> None:
        """Take the load away."""
        self._plant.bear()
