"""Registers as bench files declare them, and a unit's registers by name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError
from labdrive_spindle.modbus_bus import ModbusBus

# Registers that each type takes.
_WIDTH = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "float32": 2}


class Register(SettingsBase):
    """A value in one register, or in two."""

    address: int = Field(ge=0, le=0xFFFF, description="As in the frame: counted from 0.")
    type: Literal["int16", "uint16", "int32", "uint32", "float32"] = "uint16"
    words: Literal["big", "little"] = Field(
        default="big", description="big: the register with the high word comes first."
    )
    read: Literal[3, 4] = Field(default=3, description="Function code: 3 holding, 4 input.")
    write: Literal[6, 16] | None = Field(
        default=None, description="Function code: 6 a single register, 16 several; 16 by default."
    )
    scale: float = Field(
        default=1.0, gt=0, description="What 1 in the register means in labdrive's own unit."
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.write == 6 and self.width > 1:
            raise ValueError("function 6 writes a single register; take 16 for 32 bits")
        if self.address + self.width > 0x10000:
            raise ValueError("the second register would be beyond 0xFFFF")
        return self

    @property
    def width(self) -> int:
        """Registers that the value takes."""
        return _WIDTH[self.type]

    def decode(self, registers: Sequence[int]) -> float:
        """Return the value that registers hold, scaled."""
        from pymodbus.client import ModbusTcpClient as Client

        kind = Client.DATATYPE[self.type.upper()]
        value: Any = Client.convert_from_registers(list(registers), kind, self.words)
        return float(value) * self.scale

    def encode(self, value: float) -> list[int]:
        """Return the registers that hold a value; DeviceError if it is beyond their range."""
        from pymodbus.client import ModbusTcpClient as Client

        kind = Client.DATATYPE[self.type.upper()]
        raw = value / self.scale
        if self.type != "float32":
            raw = round(raw)
            signed = self.type.startswith("int")
            span = 1 << 16 * self.width
            low = -span // 2 if signed else 0
            if not low <= raw < low + span:
                raise DeviceError(
                    f"{raw} does not fit register 0x{self.address:04X} of type {self.type}"
                )
        return list(Client.convert_to_registers(raw, kind, self.words))


@dataclass
class Unit:
    """The registers of one unit, by name; implements `cia402.Objects`."""

    bus: ModbusBus
    number: int
    registers: Mapping[str, Register]

    def read(self, name: str) -> int:
        """Return a register as a whole number."""
        return round(self.value(self.registers[name]))

    def write(self, name: str, value: int) -> None:
        """Write a register."""
        register = self.registers[name]
        self.bus.write(
            self.number, register.address, register.encode(value), single=register.write == 6
        )

    def has(self, name: str) -> bool:
        """Whether there is a register of that name."""
        return name in self.registers

    def refuse_trouble(self) -> None:
        """Nothing is known but what registers say."""

    def value(self, register: Register) -> float:
        """Return what a register holds, scaled."""
        held = self.bus.read(self.number, register.read, register.address, register.width)
        return register.decode(held)
