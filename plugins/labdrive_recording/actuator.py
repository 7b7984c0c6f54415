"""The phases of a recording, played as an actuator that nothing can drive."""

from collections.abc import Generator
from pathlib import Path

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.quantities import AnyQuantity
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.motion import Direction, Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive.periodic.phase_map import node_phases
from labdrive_recording.table_file import CHUNK_ROWS, read_columns
from labdrive_recording.table_settings import TableSettings

TABLE_LENGTH = 256


class RecordedPhase(SettingsBase):
    """What the phase follows from: phase = 2 pi (column - its first value) / cycle."""

    column: str = Field(description="A column that runs with the phase: time, angle, counts.")
    cycle: AnyQuantity = Field(description="What the column gains in a cycle, as `1.43 s`.")
    scale: AnyQuantity | None = Field(
        default=None, description="What 1 in the column means, as `1 ms`; 1 in SI by default."
    )


class RecordedActuator:
    """Plays the phases of a recording, row by row; nothing moves."""

    class Settings(TableSettings):
        """Where the phases are."""

        phase: RecordedPhase
        time: str | None = Field(
            default=None, description="Column of the time in s; by default that of the phase."
        )

    sampling = Sampling.POLLED
    position_unit = "rad"
    max_samples_per_period: int | None = None

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        phase, file = settings.phase, settings.file
        _check_units(phase, f"actuators.{context.name}.phase")
        clock = settings.time or (phase.column if phase.cycle.unit == "s" else None)
        columns = read_columns(settings, [phase.column, clock or phase.column])
        columns[phase.column] *= phase.scale.value if phase.scale else 1.0
        running = columns[phase.column] - columns[phase.column][0]
        self._phase = TURN * running / phase.cycle.value
        if running[-1] == 0:
            message = f"column {phase.column!r} does not advance: its last value is its first"
            raise InputError(Problem(message, file=str(file)))
        if clock is None:
            # A cycle is taken to last a second, so that drift has something to run on.
            self._time = np.abs(self._phase) / TURN
        else:
            self._time = columns[clock] - columns[clock][0]
            _check_clock(self._time, clock, file)

    @property
    def fixed_motion(self) -> Motion:
        """The cycles that the recording holds, rounded; it settles nothing."""
        cycles = abs(self._phase[-1]) / TURN
        return Motion(
            periods=max(1, round(cycles)),
            samples_per_period=max(1, int((len(self._phase) - 1) / cycles)),
            period_rate_hz=float(cycles / self._time[-1]),
            settle_periods=0,
            direction=Direction.FORWARD if self._phase[-1] > 0 else Direction.BACKWARD,
        )

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return a table that is the phase itself; InputError if a waveform is asked for."""
        if waveform is not None:
            raise InputError(Problem("a recording has no choice of waveform", "waveform"))
        return WaveformTable((Channel("phase", "rad", node_phases(TABLE_LENGTH), TURN),))

    def travel_per_period(self, _table: WaveformTable) -> float:
        """Return 0: nothing moves."""
        return 0.0

    def check(self, motion: Motion) -> None:
        """Take any motion: experiments ask for the only one there is."""

    def connect(self) -> None:
        """Nothing to open: the file has been read."""

    def close(self) -> None:
        """Nothing to release."""

    def reference(self) -> None:
        """Nothing moves."""

    def load(self, table: WaveformTable) -> None:
        """Take the nominal table, and DeviceError for any other: a recording is as it is."""
        own = self.nominal_table(None).channels[0].samples
        if not all(np.array_equal(channel.samples, own) for channel in table.channels):
            raise DeviceError("a recording cannot be driven with another table than its own")

    def play(self, _acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Yield all rows, chunk by chunk; only the last is shorter, and may be empty."""
        for start in range(0, len(self._phase) + 1, CHUNK_ROWS):
            rows = slice(start, start + CHUNK_ROWS)
            yield Samples(self._phase[rows], self._time[rows])

    def make_safe(self) -> None:
        """Nothing moves."""


def _check_units(phase: RecordedPhase, field: str) -> None:
    """InputError if the cycle is nothing, or the column is in other units than the cycle."""
    if phase.cycle.value == 0:
        raise InputError(Problem("must not be 0", f"{field}.cycle"))
    if phase.scale is not None and phase.scale.unit != phase.cycle.unit:
        message = f"must have the unit of the cycle, {phase.cycle.unit}"
        raise InputError(Problem(message, f"{field}.scale", got=phase.scale.unit))


def _check_clock(time: FloatArray, column: str, file: Path) -> None:
    """InputError if time runs backwards, as where several recordings were put together."""
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        message = f"time {column!r} runs backwards after row {back[0] + 1} of the table"
        raise InputError(Problem(f"{message}; is it several recordings?", file=str(file)))
    if time[-1] == 0:
        raise InputError(Problem(f"time {column!r} stands still", file=str(file)))
