"""The response A(phi): what an actuator does over its phase, filtered to a line and harmonics."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import ComplexArray, FloatArray
from labdrive.model.waveform import TURN


@dataclass(frozen=True)
class PeriodicError:
    """Size of a periodic error: peak to valley and root mean square, in the response's unit."""

    pv: float
    rms: float


@dataclass(frozen=True, eq=False)
class Response:
    """Position against commanded phase: a line plus harmonics of the cycle.

    position(phi) = step_size * phi / 2 pi + e(phi) + constant,
    e(phi) = sum over k = 1..K of Re(C_k exp(i k phi)), C_k = `harmonics[k - 1]`.

    `standard_errors`, shape (K,), are the standard deviations of either quadrature of C_k, which
    is that of its amplitude where the harmonic stands out; each was found from the power in
    `noise_bins` bins between the harmonics. Lengths are in `unit`.
    """

    step_size: float
    harmonics: ComplexArray
    standard_errors: FloatArray
    unit: str
    estimator: str
    step_size_standard_error: float
    noise_bins: float = math.inf

    @property
    def order(self) -> int:
        """K, the highest harmonic."""
        return len(self.harmonics)

    def position(self, phase: FloatArray) -> FloatArray:
        """Return A(phase) with A(0) = 0 [unit]; phase [rad] of any shape."""
        origin = self.harmonics.real.sum()
        return np.asarray(self.step_size * phase / TURN + self.error(phase) - origin)

    def error(self, phase: FloatArray) -> FloatArray:
        """Return the periodic error e(phase), zero in the mean [unit]; phase of any shape."""
        # Horner's rule needs one exponential a phase, however many harmonics there are.
        turn = np.exp(1j * np.asarray(phase))
        total = np.zeros_like(turn)
        for harmonic in self.harmonics[::-1]:
            total = (total + harmonic) * turn
        return np.asarray(total.real, dtype=np.float64)

    def slope(self, phase: FloatArray) -> FloatArray:
        """Return dA/dphi at each phase [unit/rad]; phase of any shape."""
        rate = replace(self, harmonics=self._rates)
        return np.asarray(self.step_size / TURN + rate.error(phase))

    def error_over_cycle(self, length: int) -> FloatArray:
        """Return e at phases 2 pi j / length, j < length [unit]; length must exceed 2 K."""
        return _over_cycle(self.harmonics, length)

    def slope_over_cycle(self, length: int) -> FloatArray:
        """Return dA/dphi at phases 2 pi j / length [unit/rad]; length must exceed 2 K."""
        return self.step_size / TURN + _over_cycle(self._rates, length)

    @property
    def _rates(self) -> ComplexArray:
        return np.asarray(1j * np.arange(1, self.order + 1) * self.harmonics)

    @property
    def periodic_error(self) -> PeriodicError:
        """Peak to valley and rms of e over a cycle."""
        dense = self.error_over_cycle(dense_length(self.order))
        rms = math.sqrt(float(np.sum(np.abs(self.harmonics) ** 2)) / 2)
        return PeriodicError(pv=float(np.ptp(dense)), rms=rms)

    @property
    def noise_floor_rms(self) -> float:
        """The rms of the periodic error that noise alone would show [unit]."""
        return math.sqrt(float(np.sum(self.standard_errors**2)))

    def significant(self, false_alarm: float = 0.01) -> NDArray[np.bool_]:
        """Return which harmonics stand out of their standard errors, shape (K,).

        If there were noise alone, any would be named with probability `false_alarm` only. Over a
        known error, |C|^2 / (2 se^2) would be exponentially distributed; over an error that is a
        mean of so many bins itself, it is F-distributed, with more outliers.
        """
        power = np.abs(self.harmonics) ** 2
        chances = math.log(max(self.order, 1) / false_alarm)
        bins = self.noise_bins
        excess = chances if math.isinf(bins) else bins * math.expm1(chances / bins)
        return np.asarray(power > 2 * excess * self.standard_errors**2)

    def shrunk(self) -> "Response":
        """Return the response with each harmonic shrunk by the share that noise has in it.

        By 1 - 2 se^2 / |C|^2, not below 0: Wiener's filter with the signal's power estimated from
        the same harmonic. Of what is only noise, less than half the amplitude is left (rms); a
        harmonic that stands out is hardly touched.
        """
        power = np.abs(self.harmonics) ** 2
        noise = np.minimum(2 * self.standard_errors**2, power)
        share = np.divide(noise, power, out=np.zeros_like(power), where=power > 0)
        return replace(self, harmonics=self.harmonics * (1 - share))

    @property
    def at_noise_floor(self) -> bool:
        """True if no harmonic stands out: another update would only chase noise."""
        return not self.significant().any()


def dense_length(order: int) -> int:
    """Return a power of two with at least 64 points to a period of the highest harmonic.

    A peak between two points is then missed by 0.12 % of that harmonic at most.
    """
    return int(2 ** math.ceil(math.log2(64 * max(order, 16))))


def _over_cycle(harmonics: ComplexArray, length: int) -> FloatArray:
    """Return sum of Re(C_k exp(i k phi)) at `length` equidistant phases of a cycle."""
    if length <= 2 * len(harmonics):
        raise ValueError(f"{length} points cannot show {len(harmonics)} harmonics")
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    spectrum[1 : len(harmonics) + 1] = harmonics * (length / 2)
    return np.asarray(np.fft.irfft(spectrum, length))
