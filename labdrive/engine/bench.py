"""The bench as an experiment sees it: every answer is in the journal before it is given."""

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np

from labdrive.engine.acquisition import acquire, walk
from labdrive.engine.devices import Devices
from labdrive.engine.discovery import PluginHost
from labdrive.engine.interlocks import Interlocks, PausedError
from labdrive.engine.limits import Watch, refuse_breaches
from labdrive.engine.supervisor import MOVING, STILL, Supervisor
from labdrive.interfaces.devices import Acquisition, ReadsAtRest, Relives, RelivesLoad
from labdrive.interfaces.experiment import Setup, Tables
from labdrive.interfaces.interlocks import Interlock
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import InputError
from labdrive.model.events import (
    Event,
    Note,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
    ReturnStarted,
)
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording
from labdrive.model.waveform import WaveformTable
from labdrive.store.journal import Journal
from labdrive.store.recordings import StoredRecording, write_recording
from labdrive.store.run_folder import RunFolder
from labdrive.store.spool import SUFFIX, Spool, set_aside

PROGRESS_EVERY_S = 0.2
LOOK_AGAIN_S = 1.0


class LiveBench:
    """Drives connected devices for one run and journals all that it does."""

    def __init__(  # noqa: PLR0913 all that a run has
        self,
        devices: Devices,
        folder: RunFolder,
        journal: Journal,
        host: PluginHost,
        listen: Callable[[Event], None],
        supervisor: Supervisor | None = None,
        refuse_asked: Callable[[], None] = lambda: None,
    ) -> None:
        """`refuse_asked` raises RunInterruptedError if the run was asked to end."""
        self._devices = devices
        self._refuse_asked = refuse_asked
        self._supervisor = supervisor or Supervisor()
        self._folder = folder
        self._journal = journal
        self._host = host
        self._listen = listen
        self._recorded = 0
        self._loads_set = 0
        self._load: float | None = None
        units = {name: sensor.unit for name, sensor in devices.sensors.items()}
        at_rest = {n: s for n, s in devices.sensors.items() if isinstance(s, ReadsAtRest)}
        self._interlocks = Interlocks(devices.interlocks, units, at_rest=at_rest)
        self._watch = Watch(
            devices.limits, units, devices.position_unit, self._interlocks, self._supervisor
        )

    @property
    def setup(self) -> Setup:
        """What is known of the bench without asking it."""
        return self._devices

    def note(self, text: str) -> None:
        """Say one line to whoever watches."""
        self._listen(Note(text))

    def keep_table(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Write `tables/NAME.csv`."""
        self._folder.write_table(name, columns)

    @property
    def run(self) -> str:
        """Name of the run."""
        return self._folder.path.name

    def keep_file(self, name: str, text: str) -> None:
        """Write a text file into the run's folder."""
        self._folder.write_text(name, text)

    def record(
        self, motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
    ) -> Recording:
        """Play the table over the motion; return what the sensors read, once it is on disk."""
        self._refuse_asked()
        tables = self._devices.played(table)
        for name, played in tables.items():
            refuse_breaches(self._devices.limits, played, motion)
            self._watch.refuse_travel(self._travel(name, played, motion))
        number = self._recorded + 1
        asked = question(motion, table, label, return_to_start=return_to_start)
        self._journal.append("recording_intended", number=number, **asked)
        recording, stored = self._made(Acquisition(number, motion), tables, label)
        first = self._interlocks.first_readings()
        self._journal.append(
            "recorded",
            number=number,
            file=stored.file,
            sha256=stored.sha256,
            **({"first_readings": first} if first else {}),
        )
        self._recorded = number
        self._host.tell("labdrive_recorded", run=self._folder.path, recording=recording)
        self._listen(RecordingFinished(number, label, stored.file))
        if return_to_start:
            self._walk_back(number, motion, tables, label)
        return recording

    def _made(
        self, acquisition: Acquisition, tables: Mapping[str, WaveformTable], label: str
    ) -> tuple[Recording, StoredRecording]:
        """Make a recording and write it; one that an interlock pauses is made again, later."""
        folder, number = self._folder.path / "recordings", acquisition.number
        while True:
            self._wait_for_interlocks()
            try:
                with Spool(folder / f"{number:04d}{SUFFIX}", label) as spool:
                    recording = self._acquire(acquisition, tables, label, spool)
                    return recording, write_recording(folder, recording)
            except PausedError as paused:
                left = set_aside(folder, number)
                self._journal.append("paused", number=number, reason=str(paused), file=left)
                self.note(f"paused: {paused}")
                self._wait(paused.again_after)

    def _wait_for_interlocks(self) -> None:
        """Wait until nothing holds a recording back."""
        said: list[Interlock] = []
        while held := self._interlocks.held_back_by():
            # Each condition once: what its sensor reads is another number each time.
            if held.condition not in said:
                self._journal.append("held_back", reason=held.reason)
                self.note(f"held back: {held.reason}")
                said.append(held.condition)
            self._wait(LOOK_AGAIN_S)

    def _wait(self, seconds: float) -> None:
        """Wait, showing signs of life."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            self._refuse_asked()
            self._folder.show_life()
            time.sleep(min(left, LOOK_AGAIN_S))

    def set_load(self, force: float) -> float:
        """Put a force on the actuator; return what it came to, once that is on disk."""
        load = self._devices.bench_load
        if load is None:
            raise InputError("the bench has no `load` to set")
        number = self._loads_set + 1
        self._journal.append("load_intended", number=number, force=force)
        came_to = load.apply(force)
        self._journal.append("load_set", number=number, force=came_to)
        self._loads_set, self._load = number, force
        return came_to

    def _travel(self, name: str, table: WaveformTable, motion: Motion) -> float:
        cycles = motion.direction.sign * (motion.periods + motion.settle_periods)
        return cycles * self._devices.actuators[name].travel_per_period(table)

    def _acquire(
        self,
        acquisition: Acquisition,
        tables: Mapping[str, WaveformTable],
        label: str,
        spool: Spool,
    ) -> Recording:
        motion = acquisition.motion
        started = RecordingStarted(acquisition.number, label, motion.samples, motion.duration_s)
        self._listen(started)
        with self._moving():
            self._get_ready(tables)
            return acquire(
                [self._devices.actuators[name] for name in tables],
                self._devices.sensors,
                acquisition,
                self._watch,
                label,
                _Throttled(self._progressed, acquisition.number),
                spool.add,
            )

    @contextmanager
    def _moving(self) -> Iterator[None]:
        """Tell the supervisor that something moves, for the length of the block."""
        self._supervisor.tell(MOVING)
        try:
            yield
        finally:
            self._supervisor.tell(STILL)

    def _progressed(self, event: Event) -> None:
        self._refuse_asked()
        self._folder.show_life()
        self._listen(event)

    def _get_ready(self, tables: Mapping[str, WaveformTable]) -> None:
        """Bring each actuator to a known state and load its table.

        Whatever was sent before, or was under way when an earlier process was killed, a recording
        begins from the same state: so a resumed run repeats what an uninterrupted one gives.
        """
        for name, table in tables.items():
            self._devices.actuators[name].reference()
            self._devices.actuators[name].load(table)

    def go_on(
        self, uncertain: Sequence[Mapping[str, Any]], first_readings: Mapping[str, float]
    ) -> None:
        """Take over from an earlier process: mark what is uncertain, put the last load back."""
        self._interlocks.remember(first_readings)
        for one in uncertain:
            left = set_aside(self._folder.path / "recordings", one["number"])
            kept = {"file": left} if left and one["what"] == "recording" else {}
            self._journal.append("uncertain", **one, **kept)
        self._journal.append("resumed", recordings=self._recorded, uncertain=len(uncertain))
        self.note(f"resumed after {self._recorded} recordings")
        if self._load is not None and self._devices.bench_load is not None:
            self._devices.bench_load.apply(self._load)

    def relive(self, number: int, motion: Motion, table: Tables, *, again: bool = False) -> None:
        """Take note of a motion of an earlier process; simulators walk it once more, unread.

        A real bench is where that motion left it. `again`: the table is loaded already.
        """
        tables = self._devices.played(table)
        if not again:
            self._recorded = number
        for name, played in tables.items():
            actuator = self._devices.actuators[name]
            if isinstance(actuator, Relives):
                if not again:
                    actuator.reference()
                    actuator.load(played)
                actuator.relive(motion)

    def relive_load(self, force: float) -> None:
        """Take note of a load that an earlier process set; simulators bear it again."""
        self._loads_set += 1
        self._load = force
        if isinstance(self._devices.bench_load, RelivesLoad):
            self._devices.bench_load.relive(force)

    def return_again(self, number: int, motion: Motion, table: Tables, label: str) -> None:
        """Walk back what an earlier process began to, if nothing of it counts: in simulators.

        A real actuator is somewhere on its way, and its next motion begins from there.
        """
        tables = self._devices.played(table)
        if all(isinstance(self._devices.actuators[name], Relives) for name in tables):
            self._walk_back(number, motion, tables, label)
        else:
            self._journal.append("returned", number=number, whole=False)

    def _walk_back(
        self, number: int, motion: Motion, tables: Mapping[str, WaveformTable], label: str
    ) -> None:
        back = motion.returning()
        self._journal.append("return_intended", number=number, **question(back, tables, label))
        self._listen(ReturnStarted(back.duration_s))
        moved = [self._devices.actuators[name] for name in tables]
        try:
            with self._moving():
                walk(
                    moved,
                    self._devices.sensors,
                    Acquisition(number, back),
                    self._watch,
                    self._folder.show_life,
                )
        except PausedError as paused:
            # What is left of the way is not walked: the next recording begins from here.
            self._journal.append("returned", number=number, whole=False, reason=str(paused))
            self.note(f"the walk back was halted: {paused}")
            return
        self._journal.append("returned", number=number)


class _Throttled:
    """Passes on progress a few times a second, however small the chunks are."""

    def __init__(self, listen: Callable[[Event], None], number: int) -> None:
        self._listen = listen
        self._number = number
        self._next = time.monotonic() + PROGRESS_EVERY_S

    def __call__(self, samples: int) -> None:
        if time.monotonic() >= self._next:
            self._listen(RecordingProgress(self._number, samples))
            self._next = time.monotonic() + PROGRESS_EVERY_S


def question(
    motion: Motion, table: Tables, label: str, *, return_to_start: bool = False
) -> dict[str, Any]:
    """Return what an experiment asks for, as the journal notes it and a replay must ask again."""
    return {
        "label": label,
        "motion": asdict(motion),
        "table_sha256": table_sha256(table),
        "return_to_start": return_to_start,
    }


def table_sha256(table: Tables) -> str | dict[str, str]:
    """Identify tables in the journal: a resumed or replayed run must ask for the same."""
    if not isinstance(table, WaveformTable):
        return {name: str(table_sha256(one)) for name, one in table.items()}
    digest = hashlib.sha256()
    for channel in table.channels:
        digest.update(channel.name.encode())
        digest.update(np.ascontiguousarray(channel.samples).tobytes())
    return digest.hexdigest()
