"""Units as a person reads them: nm, µm, arcsec, deg, chosen for the size of what is shown."""

import math
from dataclasses import dataclass

ARCSEC = math.pi / 648000
STEPS = {
    "m": [(1e-12, "pm"), (1e-9, "nm"), (1e-6, "µm"), (1e-3, "mm"), (1.0, "m")],
    "rad": [(ARCSEC / 1000, "mas"), (ARCSEC, "arcsec"), (math.pi / 180, "deg")],
    "m/V": [(1e-9, "nm/V"), (1e-6, "µm/V")],
    "m/N": [(1e-9, "nm/N"), (1e-6, "µm/N")],
    "V": [(1e-6, "µV"), (1e-3, "mV"), (1.0, "V")],
    "N": [(1e-6, "µN"), (1e-3, "mN"), (1.0, "N")],
}
# How many of a unit there must be for it to read better than the next smaller one.
LEAST = {"arcsec": 0.1, "deg": 0.1}
MOST_DECIMALS = 9


@dataclass(frozen=True)
class Scale:
    """Divide an SI value by `size` to get it in `unit`."""

    size: float
    unit: str

    def text(self, value: float, digits: int = 3) -> str:
        """Return an SI value with its unit, to so many significant digits."""
        return f"{significant(value / self.size, digits)}\N{NO-BREAK SPACE}{self.unit}"

    def measured(self, value: float, error: float) -> tuple[str, str]:
        """Return value and standard error [SI] as numbers, both to two digits of the error."""
        if not error > 0:
            return significant(value / self.size, 6), significant(error / self.size)
        decimals = 1 - math.floor(math.log10(error / self.size))
        decimals = min(max(0, decimals), MOST_DECIMALS)
        value, error = value / self.size, error / self.size
        return minus(f"{value:.{decimals}f}"), f"{error:.{decimals}f}"

    def decade(self, value: float) -> str:
        """Return a decade of the scale, by the prefix that makes it a short number."""
        # A decade just reached must not be missed for a rounding error.
        step = _best(self._decimal_steps(), value * self.size * 1.001)
        return f"{value * self.size / step.size:g}\N{NO-BREAK SPACE}{step.unit}"

    def _decimal_steps(self) -> list["Scale"]:
        """Return the scales of the same dimension that are this one by powers of ten."""
        related = [steps for steps in STEPS.values() if (self.size, self.unit) in steps]
        steps = [Scale(*step) for step in (related[0] if related else [(self.size, self.unit)])]
        return [s for s in steps if abs(math.remainder(math.log10(s.size / self.size), 1)) < 1e-9]


def scale_for(unit: str, largest: float) -> Scale:
    """Return the scale in which `largest` [SI `unit`] reads best."""
    steps = [Scale(*step) for step in STEPS.get(unit, [(1.0, unit)])]
    return _best(steps, largest)


def _best(steps: list[Scale], largest: float) -> Scale:
    """Return the last of ascending steps of which there are enough, or the first."""
    fitting = [step for step in steps if abs(largest) >= LEAST.get(step.unit, 1) * step.size]
    return fitting[-1] if fitting else steps[0]


def readable(value: float, unit: str, digits: int = 3) -> str:
    """Return an SI value in the unit in which it reads best."""
    return scale_for(unit, float(f"{value:.{digits}g}")).text(value, digits)


def significant(value: float, digits: int = 3) -> str:
    """Return a number to so many significant digits, without an exponent where that is short."""
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0 or not 1e-4 <= abs(rounded) < 1e6:
        return minus(f"{rounded:.{digits}g}")
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return minus(f"{rounded:.{decimals}f}")


def minus(number: str) -> str:
    """Return a number with the sign that is set for it, rather than a hyphen."""
    return number.replace("-", "\N{MINUS SIGN}")
