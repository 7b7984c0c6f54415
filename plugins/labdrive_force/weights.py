"""Weights that a person places: on a hook, or on the upper partner of a friction pair."""

from typing import Annotated

from pydantic import Field

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import Quantity
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import DeviceError, InputError
from labdrive.model.units import format_si, parse, parse_unit

STANDARD_GRAVITY = 9.80665


class WeightsByHand:
    """Asks for each load at the terminal and takes the person's word for what it came to."""

    class Settings(SettingsBase):
        """Settings of the weights."""

        force_per_mass: Annotated[float, Quantity("N/kg")] = Field(
            default=STANDARD_GRAVITY,
            gt=0,
            description="9.80665 N/kg on a hook; times the coefficient of friction on a friction "
            "pair.",
        )

    needs_person = True

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._force_per_mass = settings.force_per_mass
        self._ask = context.ask
        self._placed = 0.0

    def connect(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to release."""

    def apply(self, force: float) -> float:
        """Ask for `force` [N]; return what the person says was placed [N]."""
        wanted = format_si(force, "N")
        mass = format_si(force / self._force_per_mass, "kg", 4)
        text = f"Place a load of {wanted} ({mass}); Enter when done, or what it is in N or kg: "
        while True:
            answer = self._answer(text).strip()
            try:
                self._placed = self._force(answer) if answer else force
            except InputError as error:
                text = (
                    f"{error}; type a force or a mass, as 20 N or 2 kg, or nothing for {wanted}: "
                )
            else:
                return self._placed

    def make_safe(self) -> None:
        """Leave the weights: whoever placed them takes them away."""

    def _answer(self, text: str) -> str:
        if self._ask is None:
            raise DeviceError("nobody is there to place a weight; run it at a terminal")
        return self._ask(text)

    def _force(self, answer: str) -> float:
        """Return the force [N] that an answer in N or kg comes to."""
        value, dimension = parse(answer)
        if dimension == parse_unit("kg").dimension:
            value *= self._force_per_mass
        elif dimension != parse_unit("N").dimension:
            raise InputError(f"{answer!r} is neither a force nor a mass")
        if value < 0:
            raise InputError("a load cannot be negative")
        return value
