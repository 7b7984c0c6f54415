"""The readings of a recording, played row by row."""

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import AnyQuantity
from labdrive.model.errors import DeviceError
from labdrive.model.recording import Sampling
from labdrive_recording.table_file import CHUNK_ROWS, read_columns
from labdrive_recording.table_settings import TableSettings


class RecordedSensor:
    """Plays a column of a recording as a sensor's readings."""

    class Settings(TableSettings):
        """Where the readings are."""

        column: str = Field(description="Column of the readings.")
        scale: AnyQuantity = Field(description="What 1 in the column means, as `0.1 deg`.")
        add_running_sum: str | None = Field(
            default=None,
            description="Column of corrections already applied, summed up before each row and "
            "added: a telescope's guide log.",
        )

    samplings = frozenset(Sampling)

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        names = [settings.column, settings.add_running_sum or settings.column]
        columns = read_columns(settings, names)
        values = columns[settings.column]
        if settings.add_running_sum is not None:
            applied = columns[settings.add_running_sum]
            values = values + np.cumsum(applied) - applied
        self._name = context.name
        self._unit = settings.scale.unit
        self._values = settings.scale.value * values
        self._next = 0

    @property
    def unit(self) -> str:
        """SI unit of the readings, that of `scale`."""
        return self._unit

    def connect(self) -> None:
        """Nothing to open: the file has been read."""

    def close(self) -> None:
        """Nothing to release."""

    def arm(self, _acquisition: Acquisition) -> None:
        """Go back to the first row."""
        self._next = 0

    def read(self, samples: Samples) -> Reading:
        """Return the rows of the chunk; DeviceError unless there are as many as phases."""
        end = self._next + len(samples.phase)
        is_last = len(samples.phase) < CHUNK_ROWS
        if end > len(self._values) or (is_last and end < len(self._values)):
            count = f"{end}" if is_last else f"{end} or more"
            raise DeviceError(
                f"sensor {self._name} holds {len(self._values)} rows for {count} phases; give "
                "actuator and sensor the same file, header, section and rows"
            )
        values = self._values[self._next : end]
        self._next = end
        return Reading(values, samples.time)
