"""Status registers without a handshake: they may lag, and still tell of the motion before."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

LOOK_S = 0.002
# What a status register tells is of the command before it for no longer than this.
STALE_S = 0.1


def wait_until(true: Callable[[], bool], seconds: float) -> bool:
    """Return whether something came true in time."""
    until = time.monotonic() + seconds
    while not true():
        if time.monotonic() > until:
            return False
        time.sleep(LOOK_S)
    return True


@dataclass
class Move:
    """A move that was just commanded, as a status register tells of it."""

    begun_at: float = field(default_factory=time.monotonic)
    seen: bool = False

    def ended(self, *, there: bool) -> bool:
        """Return whether it is over, when the status says now whether the motor is `there`.

        That is believed once the motor was seen on its way. A short move may never be seen, and one
        of no length is none: then once the status had the time to tell of it.
        """
        self.seen = self.seen or not there
        return there and (self.seen or time.monotonic() - self.begun_at > STALE_S)
