"""Tell people: mail, chat, webhooks, by apprise. Addresses hold secrets, so they are kept apart.

They come from the environment (LABDRIVE_NOTIFY, separated by blanks) and from a file that nobody
else can read (`notify.urls` in the state folder, one a line); never from recipes or schedules, and
never into run folders or logs.
"""

import asyncio
import logging
import os
from collections.abc import Sequence
from pathlib import Path

from labdrive.model.errors import InputError

log = logging.getLogger(__name__)

VARIABLE = "LABDRIVE_NOTIFY"
FILE = "notify.urls"
OTHERS = 0o077


class Notifier:
    """Sends to every address; what fails is logged, and stops nothing.

    InputError for addresses that apprise does not know, or if it is not installed.
    """

    def __init__(self, addresses: list[str]) -> None:
        self._apprise = None
        if not addresses:
            return
        try:
            import apprise
        except ImportError as error:
            message = f"{VARIABLE} needs apprise: pip install 'labdrive[notify]'"
            raise InputError(message) from error
        self._apprise = apprise.Apprise()
        for number, address in enumerate(addresses, start=1):
            if not self._apprise.add(address):
                scheme = address.partition("://")[0][:20]
                raise InputError(
                    f"notification address {number} ({scheme}://...) is not understood"
                )

    async def send(self, title: str, body: str, plots: Sequence[Path] = ()) -> None:
        """Send a message to all, with plots to those who can take them."""
        if self._apprise is None:
            return
        attached = [str(plot) for plot in plots] or None
        sent = await asyncio.to_thread(
            self._apprise.notify, title=title, body=body, attach=attached
        )
        if not sent:
            log.warning("a notification was not delivered to all: %s", title)


def addresses(state: Path) -> list[str]:
    """Return where to send; InputError if the file can be read by others, or not by us."""
    found = os.environ.get(VARIABLE, "").split()
    path = state / FILE
    if path.is_file():
        if os.name != "nt" and path.stat().st_mode & OTHERS:
            raise InputError(f"{path} can be read by others; run: chmod 600 {path}")
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            # Not chained: its text would hold what is in the file, which is secret.
            message = f"{path} is not UTF-8 text at byte {error.start}; save it as UTF-8"
            raise InputError(message) from None
        found += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return found
