"""Run what is scheduled, each run in a process of its own, until stopped."""

import argparse
import logging
import signal
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TYPE_CHECKING

from labdrive.cli import schedule

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import datetime

    from labdrive.schedule.service import Service

LOG_BYTES = 5_000_000
LOGS_KEPT = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--once", action="store_true", help="run what is due, then end; for cron")
    parser.add_argument("--store", type=Path, metavar="FILE", help="the queue's file")
    parser.add_argument("--digest", metavar="CRON", help="when to send what the last day brought")
    parser.add_argument("--tz", default="UTC", help="time zone of the digest")
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where run folders go"
    )


def execute(options: argparse.Namespace) -> int:
    """Serve; SIGTERM and Ctrl-C stop it, and what runs, in good order.

    The exit code of `--once` is 1 if a job that it ran failed for good.
    """
    import asyncio

    from labdrive.schedule.notify import Notifier, addresses
    from labdrive.schedule.process import ProcessRunner
    from labdrive.schedule.queue import Queue
    from labdrive.schedule.service import Service
    from labdrive.schedule.workers import working

    store = options.store or schedule.default_store()
    notifier, digest_after = Notifier(addresses(store.parent)), _digest_after(options)
    queue = Queue(store)
    _log_to(store.parent / "serve.log")
    with working(store.parent / "workers") as worker:
        runner = ProcessRunner(options.runs.resolve(), store.parent / "jobs")
        service = Service(queue, runner, worker, tell=notifier.send, digest_after=digest_after)
        well = asyncio.run(_until_stopped(service, once=options.once))
    queue.close()
    return 0 if well else 1


def _digest_after(options: argparse.Namespace) -> "Callable[[datetime], datetime | None]":
    """Return what says when the next digest is due; InputError if that is never said rightly."""
    from labdrive.recipe.load import load_fields
    from labdrive.schedule.calendar import times
    from labdrive.schedule.entry import Digest

    if options.digest is None:
        return lambda _: None
    due = load_fields({"digest": options.digest, "tz": options.tz}, "serve", Digest)
    return lambda after: next(times(due.digest, due.tz, after), None)


async def _until_stopped(service: "Service", *, once: bool) -> bool:
    """Serve; return whether all went well, which it did if the service was stopped."""
    import asyncio

    task: asyncio.Future[bool | None] = asyncio.ensure_future(
        service.once() if once else service.serve()
    )
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, task.cancel)
        except NotImplementedError:  # Windows: Ctrl-C raises KeyboardInterrupt instead
            break
    try:
        return await task is not False
    except asyncio.CancelledError:
        logging.getLogger(__name__).info("stopped")
        return True


class _ServiceLog(RotatingFileHandler):
    """A log that must not disturb the service when it cannot be written; standard error can."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 logging calls it so
        """Say nothing: what fills the disk is told by those whom it stops."""


def _log_to(path: Path) -> None:
    """Log into a file that is rotated, and on standard error; StoreError if it cannot be opened."""
    from labdrive.store.durable import cannot_write

    try:
        file = _ServiceLog(path, maxBytes=LOG_BYTES, backupCount=LOGS_KEPT, encoding="utf-8")
    except OSError as error:
        raise cannot_write(path, error) from error
    handlers: list[logging.Handler] = [file, logging.StreamHandler()]
    form = logging.Formatter("%(asctime)s %(levelname)s %(message)s")
    for handler in handlers:
        handler.setFormatter(form)
        logging.getLogger("labdrive").addHandler(handler)
    logging.getLogger("labdrive").setLevel(logging.INFO)
