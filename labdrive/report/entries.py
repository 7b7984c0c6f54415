"""An entry of result.json (an iteration, a verification) as numbers to draw."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.periodic.response import dense_length

Entry = Mapping[str, Any]

# Noise alone passes three standard errors (of a quadrature) once in ninety harmonics.
STANDS_OUT = 3.0


def error_over_cycle(entry: Entry) -> FloatArray:
    """Return sum of amplitude cos(k phi + phase) at equidistant phases of a cycle [SI].

    The first phase is 0, the last 2 pi; there are at least 64 to a period of any harmonic.
    """
    orders = column(entry, "k").astype(np.int64)
    length = dense_length(int(orders.max(initial=1)))
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    spectrum[orders] = column(entry, "amplitude") * np.exp(1j * column(entry, "phase"))
    curve = np.fft.irfft(spectrum, length) * (length / 2)
    return np.append(curve, curve[0])


def column(entry: Entry, name: str) -> FloatArray:
    """Return one number of every harmonic, shape (harmonics,)."""
    return np.array([harmonic[name] for harmonic in entry["harmonics"]], dtype=np.float64)


def degrees(curve: FloatArray) -> FloatArray:
    """Return the phases [deg] of a curve over a whole cycle, both ends included."""
    return np.linspace(0, 360, len(curve))
