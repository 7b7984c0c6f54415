"""Find the link that a device's settings name."""

from typing import TypeVar

from labdrive.interfaces.devices import DeviceContext
from labdrive.model.errors import InputError, Problem
from labdrive_spindle.can_bus import CanBus

Bus = TypeVar("Bus")


def claim_node(bus: CanBus, node: int, role: str, name: str) -> None:
    """Let a device of the bench have a node of a bus; InputError if that is taken."""
    owner = bus.claimed.setdefault(node, name)
    if node == bus.settings.own_node:
        owner = f"this computer's heartbeat (own_node of {bus.name})"
    if owner != name:
        message = f"is the node of {owner} already"
        raise InputError(Problem(message, f"{role}.{name}.node", got=str(node)))


def bus_of(context: DeviceContext, role: str, link: str, kind: type[Bus], word: str) -> Bus:
    """Return the bus of a kind that `link` names; InputError, with `word` for it, if it is none."""
    found = context.links.get(link)
    if not isinstance(found, kind):
        buses = [name for name, other in context.links.items() if isinstance(other, kind)]
        message = f"must name a {word} link; the bench has {', '.join(buses) or 'none'}"
        raise InputError(Problem(message, f"{role}.{context.name}.link", got=link))
    return found
