"""The phases of a recording, played as an actuator that nothing can drive."""

from collections.abc import Generator

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Samples
from labdrive.interfaces.quantities import AnyQuantity
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.errors import DeviceError, InputError, Problem
from labdrive.model.motion import Direction, Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN, Channel, WaveformTable
from labdrive.periodic.phase_map import node_phases
from labdrive_recording.table_file import TableSettings, read_columns

CHUNK_ROWS = 65536
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
        phase = settings.phase
        names = {phase.column, settings.time or phase.column}
        columns = read_columns(settings, names)
        running = columns[phase.column] * self._si(phase, context)
        self._phase = TURN * (running - running[0]) / phase.cycle.value
        time = columns[settings.time or phase.column]
        timed = settings.time is not None or phase.cycle.unit == "s"
        # Without a clock a cycle is taken to last a second, so that drift has something to run on.
        self._time = time - time[0] if timed else np.abs(self._phase) / TURN
        if self._phase[-1] == 0:
            message = "does not advance: its last value is its first"
            raise InputError(Problem(message, f"actuators.{context.name}.phase", got=phase.column))

    @staticmethod
    def _si(phase: RecordedPhase, context: DeviceContext) -> float:
        """Return what 1 in the column is in SI; InputError if its unit is not the cycle's."""
        if phase.cycle.value == 0:
            message = "must not be 0"
            raise InputError(Problem(message, f"actuators.{context.name}.phase.cycle", got="0"))
        if phase.scale is None:
            return 1.0
        if phase.scale.unit != phase.cycle.unit:
            message = f"must have the unit of the cycle, {phase.cycle.unit}"
            field = f"actuators.{context.name}.phase.scale"
            raise InputError(Problem(message, field, got=phase.scale.unit))
        return phase.scale.value

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
        (channel,) = table.channels
        if not np.array_equal(channel.samples, node_phases(TABLE_LENGTH)):
            raise DeviceError("a recording cannot be driven with another table than its own")

    def play(self, _acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Yield all rows, chunk by chunk."""
        for start in range(0, len(self._phase), CHUNK_ROWS):
            rows = slice(start, start + CHUNK_ROWS)
            yield Samples(self._phase[rows], self._time[rows])

    def make_safe(self) -> None:
        """Nothing moves."""
