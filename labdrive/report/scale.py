"""Units as a person reads them: nm, um, arcsec, deg, chosen for the size of what is shown."""

import math
from dataclasses import dataclass

STEPS = {
    "m": [(1e-12, "pm"), (1e-9, "nm"), (1e-6, "µm"), (1e-3, "mm"), (1.0, "m")],
    "rad": [(math.pi / 648000, "arcsec"), (math.pi / 180, "deg")],
    "N": [(1e-3, "mN"), (1.0, "N")],
}
# Below this many of a unit, the next smaller one reads better.
LEAST = 1.0


@dataclass(frozen=True)
class Scale:
    """Divide an SI value by `size` to get it in `unit`."""

    size: float
    unit: str

    def text(self, value: float, digits: int = 3) -> str:
        """Return an SI value with its unit, to so many significant digits."""
        return f"{significant(value / self.size, digits)} {self.unit}"


def scale_for(unit: str, largest: float) -> Scale:
    """Return the scale in which `largest` [SI `unit`] reads best."""
    steps = STEPS.get(unit, [(1.0, unit)])
    fitting = [step for step in steps if abs(largest) >= LEAST * step[0]]
    return Scale(*(fitting[-1] if fitting else steps[0]))


def readable(value: float, unit: str, digits: int = 3) -> str:
    """Return an SI value in the unit in which it reads best."""
    return scale_for(unit, float(f"{value:.{digits}g}")).text(value, digits)


def significant(value: float, digits: int = 3) -> str:
    """Return a number to so many significant digits, without an exponent where that is short."""
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0 or not 1e-4 <= abs(rounded) < 1e6:
        return f"{rounded:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{rounded:.{decimals}f}"
