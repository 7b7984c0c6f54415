"""The sensor `modbus-register`: any register of any unit, as a reading."""

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import AnyQuantity
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.recording import Sampling
from labdrive_spindle.links import bus_of
from labdrive_spindle.modbus_bus import ModbusBus
from labdrive_spindle.registers import Register, Unit


class ModbusRegister:
    """Reads a register once a sample, where the actuator stands still for it."""

    class Settings(SettingsBase):
        """Which register, and what it means."""

        link: str = Field(description="The bench's Modbus link.")
        unit: int = Field(default=1, ge=1, le=247, description="Number of the unit that has it.")
        value: Register = Field(description="Where it is.")
        one: AnyQuantity = Field(description="What 1 in the register means, as `1 nm`, `0.1 K`.")

    samplings = frozenset({Sampling.POLLED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        bus = bus_of(context, "sensors", settings.link, ModbusBus, "modbus")
        self._unit = Unit(bus, settings.unit, {})

    @property
    def unit(self) -> str:
        """SI unit of the readings, that of `one`."""
        return self._settings.one.unit

    def connect(self) -> None:
        """Read the register once: DeviceError if there is none."""
        self.read_at_rest()

    def close(self) -> None:
        """Nothing to release: the link is the bench's."""

    def arm(self, _acquisition: Acquisition) -> None:
        """Nothing to get ready."""

    def read(self, samples: Samples) -> Reading:
        """Return the register as it is now."""
        return Reading(np.array([self.read_at_rest()]), samples.time[-1:])

    def read_at_rest(self) -> float:
        """Return what the register holds [the unit of `one`]."""
        return self._settings.one.value * self._unit.value(self._settings.value)
