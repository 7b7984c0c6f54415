"""What every section of a recipe or bench is made of."""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, field_validator


class Settings(BaseModel):
    """A section of a recipe or bench: unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
    )

    @field_validator("*", mode="before")
    @classmethod
    def _lists_do_not_change(cls, given: Any) -> Any:
        """Turn a file's lists into tuples, which is what settings hold."""
        return tuple(given) if isinstance(given, list) else given


@dataclass(frozen=True)
class BenchName:
    """Marks a field, `Annotated[str, BenchName("sensors")]`, that names a device of the bench."""

    role: str


SensorName = Annotated[str, BenchName("sensors")]
ActuatorName = Annotated[str, BenchName("actuators")]


@dataclass(frozen=True)
class PluginSlot:
    """Marks a field, `Annotated[Settings, PluginSlot("optimizers")]`, that a plugin fills.

    In the file the field is a mapping with the plugin's name under `key` and the plugin's own
    settings beside it; in the validated settings it is an instance of that plugin's `Settings`
    with one more attribute, `key`.
    """

    role: str
    key: str = "use"
