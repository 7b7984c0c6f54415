"""What every section of a recipe or bench is made of."""

from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator


class Settings(BaseModel):
    """A section of a recipe or bench: unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
    )

    @field_validator("*", mode="before")
    @classmethod
    def _lists_for_tuples(cls, given: Any, info: ValidationInfo) -> Any:
        """Take a file's list where a tuple is due: strict validation would not."""
        if not isinstance(given, list) or info.field_name is None:
            return given
        annotation = cls.model_fields[info.field_name].annotation
        due = (annotation, *get_args(annotation))
        return tuple(given) if any(get_origin(one) is tuple for one in due) else given


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
