"""Which fields a model has at the place where pydantic met an unknown one."""

from collections.abc import Iterable, Iterator
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Tag

from labdrive.recipe.models import TAG


def fields_at(root: object, location: Iterable[str | int]) -> set[str]:
    """Return the names of the fields at a location of a pydantic error within the type `root`."""
    here = list(_members(root))
    for part in location:
        here = [inside for tag, member in here for inside in _inside(tag, member, part)]
    return {name for _, member in here if _is_model(member) for name in member.model_fields}


_Member = tuple[str | None, Any]
"""One of the types a value may have, and the tag that chooses it, where one does."""


def _members(annotation: Any, tag: str | None = None) -> Iterator[_Member]:
    """Take unions and annotations apart."""
    if get_origin(annotation) is Annotated:
        inner, *marks = get_args(annotation)
        tags = [mark.tag for mark in marks if isinstance(mark, Tag)]
        yield from _members(inner, tags[0] if tags else tag)
    elif get_origin(annotation) in (Union, UnionType):
        for member in get_args(annotation):
            yield from _members(member, tag)
    else:
        yield tag, annotation


def _inside(tag: str | None, member: Any, part: str | int) -> Iterator[_Member]:
    """Go one step of a location down, or stay where the step only names a choice."""
    if isinstance(part, str) and part.startswith(TAG):
        if tag in (part, None):
            yield tag, member
    elif _is_model(member) and part in member.model_fields:
        yield from _members(member.model_fields[part].annotation)
    elif get_origin(member) in (list, tuple, dict):
        yield from _members(get_args(member)[-1 if get_origin(member) is dict else 0])
    elif part == getattr(member, "__name__", None):
        yield tag, member


def _is_model(member: object) -> bool:
    return isinstance(member, type) and issubclass(member, BaseModel)
