"""Regression on line, drift and harmonics of the phase, by normal equations in constant memory."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labdrive.model.arrays import ComplexArray, FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.waveform import TURN
from labdrive.periodic.noise import Noise, one_level, residual_noise, squared_gain

CHUNK_ELEMENTS = 1 << 20
CELLS = 1 << 18
# Below this, an eigenvalue of the normal matrix of unit columns is all rounding.
LEAST_EIGENVALUE = 1e-9


@dataclass(frozen=True, eq=False)
class Fit:
    """Solution of normal equations and the inverse of their matrix, in the order of the columns."""

    solution: FloatArray
    inverse: FloatArray


@dataclass(frozen=True, eq=False)
class Regression:
    """Fits position by constant, line in phase, drift in time, harmonics 1..`order` of the phase.

    `phase` [rad], `time` and `position` have shape (samples,). The drift is a sum of Legendre
    polynomials of degree 2 to `drift_order` over the span of the time. A linear drift cannot be
    told from a step size, so orders 0 and 1 add nothing.
    """

    phase: FloatArray
    time: FloatArray
    position: FloatArray
    order: int
    drift_order: int

    @property
    def drifts(self) -> int:
        """Number of drift terms beyond the line."""
        return max(self.drift_order - 1, 0)

    @property
    def unknowns(self) -> int:
        """Number of columns."""
        return 2 + self.drifts + 2 * self.order

    @cached_property
    def half_span(self) -> float:
        """Half the phase walked [rad]."""
        return float(np.ptp(self.phase)) / 2

    @property
    def cycles(self) -> float:
        """Cycles walked."""
        return self.half_span / np.pi

    @cached_property
    def slope(self) -> float:
        """Slope from end to end [unit/rad]: taken out first, so that travel costs no digits."""
        walked = self.phase[-1] - self.phase[0]
        return float((self.position[-1] - self.position[0]) / walked) if walked else 0.0

    def chunks(self) -> Iterator[slice]:
        """Yield stretches of samples whose rows fit a fixed memory."""
        size = max(CHUNK_ELEMENTS // self.unknowns, 1)
        for start in range(0, len(self.phase), size):
            yield slice(start, start + size)

    def left(self, chunk: slice, fit: Fit | None = None) -> FloatArray:
        """Return what the end-to-end line leaves of the positions, and the fit if there is one."""
        line = self.position[0] + self.slope * (self.phase[chunk] - self.phase[0])
        left = self.position[chunk] - line
        return np.asarray(left if fit is None else left - self.rows(chunk) @ fit.solution)

    def rows(self, chunk: slice) -> FloatArray:
        """Return the rows of a stretch of samples, shape (samples, unknowns)."""
        phase = self.phase[chunk]
        rows = np.empty((len(phase), self.unknowns))
        rows[:, 0] = 1
        rows[:, 1] = (phase - self.phase[0]) / self.half_span
        if self.drifts:
            drift = np.polynomial.legendre.legvander(self._unit_time(chunk), self.drift_order)
            rows[:, 2 : 2 + self.drifts] = drift[:, 2:]
        # Powers of one turn cost a fifth of as many exponentials.
        turn = np.exp(1j * phase)[:, np.newaxis]
        turning = np.cumprod(np.broadcast_to(turn, (len(phase), self.order)), axis=1)
        rows[:, -2 * self.order : -self.order] = turning.real
        rows[:, -self.order :] = turning.imag
        return rows

    def fit(self) -> Fit:
        """Return the least-squares fit; EstimationError if the phases do not determine it."""
        return solved((self.rows(chunk), self.left(chunk)) for chunk in self.chunks())

    def step_size(self, fit: Fit) -> float:
        """Return travel in a cycle of rising phase [unit]."""
        return float(TURN * (self.slope + fit.solution[1] / self.half_span))

    def harmonics(self, fit: Fit) -> ComplexArray:
        """Return C_k, k = 1..order [unit]."""
        cosines, sines = fit.solution[-2 * self.order : -self.order], fit.solution[-self.order :]
        return np.asarray(cosines - 1j * sines)

    def noise(self, fit: Fit) -> Noise:
        """Return the noise that the fit leaves between harmonics; without room there, one level."""
        cells_a_cycle = 2 ** math.ceil(math.log2(16 * self.order))
        cycles = max(1, min(int(self.cycles + 1e-6), CELLS // cells_a_cycle))
        cells, lowest = np.zeros(cycles * cells_a_cycle), self.phase.min()
        samples, squares = 0, 0.0
        for chunk in self.chunks():
            left = self.left(chunk, fit)
            numbers = ((self.phase[chunk] - lowest) / TURN * cells_a_cycle).astype(np.int64)
            inside = numbers < len(cells)
            cells += np.bincount(numbers[inside], left[inside], len(cells))
            samples += int(inside.sum())
            squares += float(left @ left)
        found = residual_noise(cells, cycles, samples, self.order, self.drift_order)
        freedom = len(self.phase) - self.unknowns
        return found or one_level(squares / freedom, freedom, self.order)

    def noise_at_harmonics(self, noise: Noise) -> FloatArray:
        """Return the variance of a sample of white noise as strong as that near each harmonic."""
        orders = np.arange(1.0, self.order + 1)
        gain = squared_gain(orders * self.cycles / len(self.phase))
        return np.asarray((noise.white + noise.walk / gain) * noise.excess[1:])

    def _unit_time(self, chunk: slice) -> FloatArray:
        first, last = float(self.time.min()), float(self.time.max())
        return np.asarray((2 * self.time[chunk] - first - last) / (last - first))


def solved(stretches: Iterator[tuple[FloatArray, FloatArray]]) -> Fit:
    """Solve the normal equations of (rows, values), columns scaled to unit length.

    EstimationError if they are singular: the rows leave some unknown undetermined.
    """
    normal, moment = np.zeros((1, 1)), np.zeros(1)
    for rows, values in stretches:
        normal, moment = normal + rows.T @ rows, moment + rows.T @ values
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    eigenvalues, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    if eigenvalues[0] < LEAST_EIGENVALUE:
        raise EstimationError(
            "the recorded phases leave some of the unknowns undetermined; "
            "ask for fewer harmonics or a lower drift order, or record more cycles"
        )
    inverse = (vectors / eigenvalues) @ vectors.T / np.outer(scale, scale)
    return Fit(inverse @ moment, inverse)
