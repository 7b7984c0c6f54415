"""A measured value."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Measured:
    """A value and its standard error, in the same unit."""

    value: float
    standard_error: float
