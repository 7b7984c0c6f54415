"""What can be wrong with the answers of an emulated device, on any bus."""

from dataclasses import dataclass


@dataclass
class Faults:
    """Answers late, cut short or spoilt, missing, or under another node's number."""

    delay_s: float = 0.0
    garble: bool = False
    silent: bool = False
    as_node: int | None = None
