"""Find the link that a device's settings name."""

from typing import TypeVar

from labdrive.interfaces.devices import DeviceContext
from labdrive.model.errors import InputError, Problem

Bus = TypeVar("Bus")


def bus_of(context: DeviceContext, role: str, link: str, kind: type[Bus], word: str) -> Bus:
    """Return the bus of a kind that `link` names; InputError, with `word` for it, if it is none."""
    found = context.links.get(link)
    if not isinstance(found, kind):
        buses = [name for name, other in context.links.items() if isinstance(other, kind)]
        message = f"must name a {word} link; the bench has {', '.join(buses) or 'none'}"
        raise InputError(Problem(message, f"{role}.{context.name}.link", got=link))
    return found
