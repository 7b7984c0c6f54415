"""The units that may be written, their sizes and dimensions."""

from dataclasses import dataclass
from decimal import Context, Decimal
from itertools import product

Dimension = tuple[float, ...]
"""Exponents, whole or half, of the base units below, in their order."""

BASE_UNITS = ("m", "kg", "s", "A", "K", "rad", "count", "px")

DECIMAL = Context(prec=60)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494")


@dataclass(frozen=True)
class Unit:
    """A unit's size in coherent SI and its dimension."""

    size: Decimal
    dimension: Dimension

    def times(self, other: "Unit") -> "Unit":
        """Return the product."""
        exponents = (a + b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(DECIMAL.multiply(self.size, other.size), tuple(exponents))

    def power(self, exponent: float) -> "Unit":
        """Return the unit to a whole power, or to the power one half."""
        size = DECIMAL.power(self.size, Decimal(exponent))
        return Unit(size, tuple(e * exponent for e in self.dimension))


def _unit(size: str | Decimal = "1", **exponents: float) -> Unit:
    return Unit(Decimal(size), tuple(exponents.get(base, 0.0) for base in BASE_UNITS))


PREFIXES = (
    {"Y": 24, "Z": 21, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1}
    | {"d": -1, "c": -2, "m": -3, "µ": -6, "μ": -6, "u": -6, "n": -9, "p": -12, "f": -15}
    | {"a": -18, "z": -21, "y": -24}
)
"""Powers of ten. Of several for one power the last is the one written."""

PREFIXED = {
    "m": _unit(m=1),
    "g": _unit("0.001", kg=1),
    "s": _unit(s=1),
    "A": _unit(A=1),
    "K": _unit(K=1),
    "rad": _unit(rad=1),
    "N": _unit(m=1, kg=1, s=-2),
    "V": _unit(m=2, kg=1, s=-3, A=-1),
    "Hz": _unit(s=-1),
    "F": _unit(m=-2, kg=-1, s=4, A=2),
    "Ohm": _unit(m=2, kg=1, s=-3, A=-2),
    "Ω": _unit(m=2, kg=1, s=-3, A=-2),
    "\N{OHM SIGN}": _unit(m=2, kg=1, s=-3, A=-2),
    "Pa": _unit(m=-1, kg=1, s=-2),
    "J": _unit(m=2, kg=1, s=-2),
    "W": _unit(m=2, kg=1, s=-3),
}
PLAIN = {
    "min": _unit("60", s=1),
    "h": _unit("3600", s=1),
    "deg": _unit(DECIMAL.divide(_PI, Decimal(180)), rad=1),
    "°": _unit(DECIMAL.divide(_PI, Decimal(180)), rad=1),
    "arcmin": _unit(DECIMAL.divide(_PI, Decimal(10800)), rad=1),
    "arcsec": _unit(DECIMAL.divide(_PI, Decimal(648000)), rad=1),
    "rev": _unit(DECIMAL.multiply(_PI, Decimal(2)), rad=1),
    "turn": _unit(DECIMAL.multiply(_PI, Decimal(2)), rad=1),
    "count": _unit(count=1),
    "px": _unit(px=1),
    "%": _unit("0.01"),
    "1": _unit(),
}
SYMBOLS = {
    prefix + symbol: Unit(unit.size.scaleb(exponent), unit.dimension)
    for (prefix, exponent), (symbol, unit) in product(PREFIXES.items(), PREFIXED.items())
}
SYMBOLS |= PREFIXED | PLAIN
