"""Walk the validated settings of a recipe, section by section."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo


@dataclass(frozen=True)
class Field:
    """A field that a recipe has: where it stands, how it was declared, what it holds."""

    path: str
    info: FieldInfo
    value: Any


def fields_of(settings: BaseModel, above: str = "") -> Iterator[Field]:
    """Yield every field, those of sections and of lists of sections after the one they are in."""
    for name, info in type(settings).model_fields.items():
        value, path = getattr(settings, name), f"{above}{name}"
        yield Field(path, info, value)
        many = isinstance(value, (list, tuple))
        entries = [(f"{path}.{i}", one) for i, one in enumerate(value)] if many else [(path, value)]
        for place, entry in entries:
            if isinstance(entry, BaseModel):
                yield from fields_of(entry, f"{place}.")
