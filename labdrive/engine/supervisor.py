"""A process beside each run, on its own timer: what a run that died or froze cannot do, it does.

The run tells it over a pipe when something moves, what each chunk of readings spans, and when all
is over; each chunk leaves a sign of life in the run folder besides. If the pipe closes without a
word, the run has died. If something moves and there is no sign of life for `limits.silence`, or a
reading beyond a limit was told and the run still moves `REACTION_S` later, the run is ended. Either
way the bench is made safe, by connecting to it anew. Not on Windows, whose pipes cannot be waited
for in this way.
"""

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from labdrive.model.errors import BusyError, StoreError
from labdrive.store.lock import bench_lock, held
from labdrive.store.run_folder import ALIVE, RunFolder

LOOK_S = 0.2
MOVING, STILL, OVER = "moving", "still", "over"
BOUNDS, READ = "bounds", "read"
CLOSED: list[str] = []
# The run itself reacts within a chunk, and says so; it may have to wait for devices.
REACTION_S = 2.0
LOCK_PATIENCE_S = 30.0


@dataclass(frozen=True)
class Supervisor:
    """The run's end of the pipe."""

    pipe: IO[str] | None = None

    def tell(self, word: str) -> None:
        """Say that something moves, that it is still, or that all is over."""
        self._say(word)

    def tell_bounds(self, sensor: str, low: float, high: float) -> None:
        """Say between which values a sensor's readings must stay [its unit]."""
        self._say(BOUNDS, sensor, low, high)

    def tell_reading(self, sensor: str, low: float, high: float) -> None:
        """Say what a chunk of readings spans [the sensor's unit]."""
        self._say(READ, sensor, low, high)

    def _say(self, *words: object) -> None:
        if self.pipe is not None:
            with suppress(OSError):  # a supervisor that is gone must not end the run
                self.pipe.write(json.dumps(words) + "\n")
                self.pipe.flush()


@contextmanager
def supervised(folder: Path, bench: str, silence_s: float) -> Iterator[Supervisor]:
    """Have a process beside the block that makes the bench safe if the block cannot."""
    if os.name == "nt":
        yield Supervisor()
        return
    command = [sys.executable, "-m", "labdrive", "supervise", str(folder), bench, str(silence_s)]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(  # noqa: S603 our own command
        command,
        stdin=subprocess.PIPE,
        stdout=quiet,
        stderr=quiet,
        text=True,
        start_new_session=True,
    )
    supervisor = Supervisor(process.stdin)
    try:
        yield supervisor
    finally:
        supervisor.tell(OVER)


def supervise(folder: RunFolder, bench: Path, silence_s: float) -> None:
    """Watch over the run that is this process's parent, until it is over; then make it safe."""
    reason = _watch(os.getppid(), folder.path / ALIVE, silence_s)
    if reason:
        _make_safe(folder, bench, reason)


def _watch(run: int, alive: Path, silence_s: float) -> str:
    """Return what became of the run: "" if it ended as it should."""
    told = _Told()
    for lines in _heard():
        for line in lines:
            told.take(*json.loads(line))
        if told.over or lines is CLOSED:
            return "" if told.over else "the run's process died"
        told.see(_changed(alive))
        reason = told.trouble(silence_s)
        if reason:
            with suppress(ProcessLookupError):
                os.kill(run, signal.SIGKILL)
            return f"{reason}; the run's process was ended"
    raise AssertionError  # what is heard ends with CLOSED


def _changed(path: Path) -> float:
    """Return when a file was last changed, 0 if it cannot be told."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _heard() -> Iterator[list[str]]:
    """Yield whole lines as they come, none where none came in `LOOK_S`, CLOSED at the end."""
    rest = b""
    while True:
        if not select.select([sys.stdin.fileno()], [], [], LOOK_S)[0]:
            yield []
            continue
        data = os.read(sys.stdin.fileno(), 65536)
        if not data:
            yield CLOSED
        *lines, rest = (rest + data).split(b"\n")
        yield [line.decode() for line in lines]


@dataclass
class _Told:
    """What the run has said of itself so far.

    All times are of the monotonic clock: that of the day may be set while the run moves.
    """

    over: bool = False
    moving: bool = False
    sign: float = 0.0
    lived: float = field(default_factory=time.monotonic)
    breach: str = ""
    breached: float = 0.0
    bounds: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def take(self, word: str, *more: Any) -> None:
        """Take a line."""
        if word == BOUNDS:
            sensor, low, high = more
            self.bounds.setdefault(sensor, []).append((low, high))
        elif word == READ:
            self._take_reading(*more)
        else:
            self.over, self.moving = word == OVER, word == MOVING
            self.lived, self.breach = time.monotonic(), ""

    def see(self, sign: float) -> None:
        """Take note of the time of the run's last sign of life: another one is a new sign."""
        if sign != self.sign:
            self.sign, self.lived = sign, time.monotonic()

    def _take_reading(self, sensor: str, low: float, high: float) -> None:
        for lowest, highest in self.bounds.get(sensor, ()):
            if not self.breach and (low < lowest or high > highest):
                beyond = low if low < lowest else high
                self.breach = f"{sensor} read {beyond:g}, beyond {lowest:g} to {highest:g}"
                self.breached = time.monotonic()

    def trouble(self, silence_s: float) -> str:
        """Return why the run has to be ended, "" if it need not be."""
        now = time.monotonic()
        if self.moving and now - self.lived > silence_s:
            return f"no sign of life for {silence_s:g} s while moving"
        if self.moving and self.breach and now - self.breached > REACTION_S:
            return f"{self.breach}, and the run moved on"
        return ""


def _make_safe(folder: RunFolder, bench: Path, reason: str) -> None:
    """Make every actuator safe, then write down why, and how that went."""
    try:
        with _lock(bench):
            # While the bench is held nobody resumes this run, and writes its run.json as well.
            _note(folder, f"{reason}; {_made_safe(folder, bench)}")
    except BusyError as error:  # whoever has the bench now answers for it, and for run.json
        _log(folder, f"{reason}; it was not made safe: {error}")


@contextmanager
def _lock(bench: Path) -> Iterator[None]:
    """Hold the bench's lock; go on without if its file cannot be written, as on a full disk."""
    with ExitStack() as stack:
        with suppress(StoreError):
            lock = held(bench_lock(bench), f"the bench {bench}", "(made safe)", LOCK_PATIENCE_S)
            stack.enter_context(lock)
        yield


def _made_safe(folder: RunFolder, bench: Path) -> str:
    """Connect to the bench and make every actuator safe; return in words how that went."""
    # Imported late: beside every run there is a process like this, and most have nothing to do.
    from labdrive.engine.devices import build, made_safe
    from labdrive.engine.discovery import discover
    from labdrive.recipe.load import load_bench

    try:
        plugins = discover().plugins
        settings = load_bench(folder.path / "bench.yaml", plugins)
        devices = build(settings, plugins, next(iter(settings.actuators)), 0, bench.parent)
        failed = made_safe(devices)
    except (Exception, SystemExit) as error:  # noqa: BLE001 a plugin may fail in any way
        return f"it could not be made safe: {type(error).__name__}: {error}"
    safe = ", ".join(name for name in devices.actuators if name not in failed)
    wrong = "".join(f"; NOT made safe: {name}: {why}" for name, why in failed.items())
    return f"made safe: {safe or 'none'}{wrong}"


def _note(folder: RunFolder, text: str) -> None:
    """Write into run.json and log.txt why the run ended, as far as they can be written."""
    _log(folder, text)
    now = datetime.now(UTC).isoformat()
    try:
        info = folder.read_run()
        if info.get("status") == "running":
            folder.write_run({**info, "status": "failed", "reason": text, "ended": now})
    except StoreError as error:
        _log(folder, str(error))


def _log(folder: RunFolder, text: str) -> None:
    line = f"{datetime.now(UTC).isoformat()} supervisor: {text}\n"
    with suppress(OSError), (folder.path / "log.txt").open("a", encoding="utf-8") as file:
        file.write(line)
