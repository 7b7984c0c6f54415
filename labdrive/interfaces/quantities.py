"""Settings that have a unit: text in the file, SI floats inside.

`height: Length = Field(gt=0)` takes `5 um` and holds 5e-6. A bare number is an error that says
what is due. Defaults are given in SI and are not checked.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidatorFunctionWrapHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from labdrive.model.errors import InputError
from labdrive.model.unit_symbols import PREFIXED, PREFIXES, SYMBOLS, Dimension
from labdrive.model.units import canonical_unit, format_si, parse, parse_unit

_EXAMPLES = {
    "m": "5 um",
    "V": "48 V",
    "Hz": "2 Hz",
    "N": "10 N",
    "s": "0.5 s",
    "rad": "90 deg",
    "m/s": "10 um/s",
    "V/s": "2 kV/s",
    "A": "35 mA",
    "F": "120 nF",
    "Ohm": "10 kOhm",
    "N/m": "100 N/um",
    "m/V": "36 nm/V",
    "m/sqrt(s)": "0.3 nm/sqrt(s)",
    "kg": "250 g",
    "K": "293 K",
    "N*s/m": "20 N*s/m",
    "N*m": "5 mN*m",
}


class SiFloat(float):
    """An SI value that could have been given in units of several dimensions; `unit` says which."""

    unit: str

    def __new__(cls, value: float, unit: str) -> Self:
        """Return `value` [unit]."""
        new = super().__new__(cls, value)
        new.unit = unit
        return new


def unit_of(value: float) -> str | None:
    """Return the unit that a value of several possible dimensions was given in, else None."""
    return value.unit if isinstance(value, SiFloat) else None


class Quantity:
    """Marks a float, `Annotated[float, Quantity("m")]`, that files give as text with a unit.

    `units` are coherent SI. With more than one, text of either dimension is taken and the value
    is an `SiFloat`.
    """

    def __init__(self, *units: str) -> None:
        self.units = units
        self._unit_of = {parse_unit(unit).dimension: unit for unit in units}

    @property
    def example(self) -> str:
        """Text that would do."""
        return " or ".join(_EXAMPLES.get(unit, f"1 {unit}") for unit in self.units)

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(
            self._value, handler(source), serialization=_as_text(self._text)
        )

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        pattern = "|".join(_pattern(dimension) for dimension in self._unit_of)
        return {"type": "string", "pattern": pattern, "examples": self.example.split(" or ")}

    def _value(self, given: object, within_bounds: ValidatorFunctionWrapHandler) -> float:
        value, dimension = _parsed(given, self.example)
        if dimension not in self._unit_of:
            found = canonical_unit(dimension)
            raise _error(f"a unit like that of {self.example} is due, not {found}")
        within_bounds(value)
        return value if len(self.units) == 1 else SiFloat(value, self._unit_of[dimension])

    def _text(self, value: float) -> str:
        return format_si(value, getattr(value, "unit", self.units[0]))


@dataclass(frozen=True)
class AnyQuantity:
    """A value of any dimension: `value` in `unit`, which is coherent SI (`rad/count`, `m`, `1`)."""

    value: float
    unit: str

    @classmethod
    def __get_pydantic_core_schema__(cls, _: type[Any], __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            cls._of, serialization=_as_text(lambda given: format_si(given.value, given.unit))
        )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "pattern": f"{_NUMBER}\\S", "examples": ["0.044 deg", "1 um/V"]}

    @classmethod
    def _of(cls, given: object) -> "AnyQuantity":
        if isinstance(given, AnyQuantity):
            return given
        value, dimension = _parsed(given, "0.044 deg, or 3 1 for a pure number")
        return cls(value, canonical_unit(dimension))


def _as_text(write: Callable[[Any], str]) -> core_schema.SerSchema:
    return core_schema.plain_serializer_function_ser_schema(write, when_used="json-unless-none")


def _parsed(given: object, example: str) -> tuple[float, Dimension]:
    if isinstance(given, (int, float)) and not isinstance(given, bool):
        raise _error(f"a number needs a unit here, as in {example}")
    if not isinstance(given, str):
        raise _error(f"a number with a unit is due, as in {example}")
    try:
        return parse(given)
    except InputError as error:
        due = "" if "as in" in str(error) else f"; write it as in {example}"
        raise _error(f"{error}{due}") from error


def _error(message: str) -> PydanticCustomError:
    return PydanticCustomError("quantity", "{message}", {"message": message})


_NUMBER = r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*"


def _pattern(dimension: Dimension) -> str:
    """Return a pattern for an editor: a lone unit must fit, what is composed may."""
    prefix = f"({'|'.join(PREFIXES)})?"
    plain = [s for s in SYMBOLS if SYMBOLS[s].dimension == dimension and len(s) <= 6]
    prefixed = [s for s in PREFIXED if PREFIXED[s].dimension == dimension]
    alone = [prefix + s for s in prefixed]
    alone += [s for s in plain if not any(s.endswith(end) for end in prefixed)]
    return f"{_NUMBER}({'|'.join((*alone, _COMPOSED))})\\s*$"


_COMPOSED = r"\S.*[*·/^ ²³⁻(].*|/.*"

Length = Annotated[float, Quantity("m")]
Voltage = Annotated[float, Quantity("V")]
Frequency = Annotated[float, Quantity("Hz")]
Force = Annotated[float, Quantity("N")]
Time = Annotated[float, Quantity("s")]
Angle = Annotated[float, Quantity("rad")]
AngleOrLength = Annotated[float, Quantity("m", "rad")]
Velocity = Annotated[float, Quantity("m/s")]
SlewRate = Annotated[float, Quantity("V/s")]
Current = Annotated[float, Quantity("A")]
Capacitance = Annotated[float, Quantity("F")]
Resistance = Annotated[float, Quantity("Ohm")]
Stiffness = Annotated[float, Quantity("N/m")]
LengthPerVoltage = Annotated[float, Quantity("m/V")]
LengthPerRootTime = Annotated[float, Quantity("m/sqrt(s)")]
Mass = Annotated[float, Quantity("kg")]
Temperature = Annotated[float, Quantity("K")]
Viscosity = Annotated[float, Quantity("N*s/m")]
Torque = Annotated[float, Quantity("N*m")]


class ExistingFile:
    """Marks a path that a recipe or bench names relative to itself and that must exist.

    Validation takes the folder of the YAML file from the context key `folder`; the value is an
    absolute path.
    """

    def __get_pydantic_core_schema__(self, _: type[Any], __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self._path, serialization=core_schema.to_string_ser_schema(when_used="json-unless-none")
        )

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "description": "A file, relative to the one that names it."}

    def _path(self, given: object, info: core_schema.ValidationInfo) -> Path:
        return self.path(given, info.context)

    def path(self, given: object, context: Mapping[str, Any] | None) -> Path:
        """Return the absolute path; PydanticCustomError if there is no such file."""
        if not isinstance(given, (str, Path)) or "\0" in str(given) or not str(given):
            raise PydanticCustomError("file", "the name of a file is due")
        path = Path((context or {}).get("folder", ".")) / given
        if not path.is_file():
            raise PydanticCustomError("file", "{message}", {"message": _missing(path)})
        return path.resolve()


def _missing(path: Path) -> str:
    """Say which file is missing and, if a README nearby can help, where to read on."""
    shown = Path(os.path.normpath(path))
    if shown.is_dir():
        return f"{shown} is a folder, not a file"
    near = next((folder for folder in list(shown.parents)[:3] if folder.is_dir()), shown)
    readme = near / "README.md"
    help_text = f"; see {readme} for where to get it" if readme.is_file() else ""
    return f"there is no file {shown}{help_text}"


InputFile = Annotated[Path, ExistingFile()]
