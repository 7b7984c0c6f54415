"""Least squares on the real phases: for polled, jittered or gapped recordings of any span."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN
from labdrive.periodic.checks import not_finite, readings_of
from labdrive.periodic.noise import Noise, residual_noise, squared_gain
from labdrive.periodic.response import Response

CHUNK_ELEMENTS = 1 << 20
CELLS = 1 << 18
MOST_DEFAULT_HARMONICS = 64
# Below this share of the mean, an eigenvalue of the scaled normal matrix is all rounding.
LEAST_EIGENVALUE = 1e-9


@dataclass(frozen=True, eq=False)
class Design:
    """What is fitted: constant, line in phase, drift in time, harmonics 1..`order` of the phase.

    The drift is a sum of Legendre polynomials of degree 2 to `drift_order` over the time of the
    recording. A linear drift cannot be told from a step size, so 0 and 1 add nothing.
    """

    phase: FloatArray
    time: FloatArray
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

    @property
    def half_span(self) -> float:
        """Half the phase walked [rad]."""
        return float(np.ptp(self.phase)) / 2

    def chunks(self) -> Iterator[slice]:
        """Yield stretches of samples whose rows fit a fixed memory."""
        size = max(CHUNK_ELEMENTS // self.unknowns, 1)
        for start in range(0, len(self.phase), size):
            yield slice(start, start + size)

    def rows(self, chunk: slice) -> FloatArray:
        """Return the rows of a stretch of samples, shape (samples, unknowns)."""
        phase = self.phase[chunk]
        rows = np.empty((len(phase), self.unknowns))
        rows[:, 0] = 1
        rows[:, 1] = (phase - self.phase[0]) / self.half_span
        if self.drifts:
            rows[:, 2 : 2 + self.drifts] = _legendre(self._unit_time(chunk), self.drift_order)
        turning = np.exp(1j * np.outer(phase, np.arange(1, self.order + 1)))
        rows[:, -2 * self.order : -self.order] = turning.real
        rows[:, -self.order :] = turning.imag
        return rows

    def _unit_time(self, chunk: slice) -> FloatArray:
        first, last = float(self.time.min()), float(self.time.max())
        return np.asarray((2 * self.time[chunk] - first - last) / (last - first))


@dataclass(frozen=True, eq=False)
class Fit:
    """Solution of the normal equations and their inverse, in the columns of the design."""

    solution: FloatArray
    inverse: FloatArray


def least_squares(
    recording: Recording, sensor: str, drift_order: int, harmonics: int | None
) -> Response:
    """Return the response fitted to the real phases, with a drift of `drift_order` in time.

    By default there are as many harmonics as a quarter of the samples in a cycle, 64 at most.
    Rows are made and summed stretch by stretch, so memory does not grow with the recording.

    EstimationError for values that are not finite, less than a cycle, fewer samples than
    unknowns, or phases that leave some unknown undetermined.
    """
    position = readings_of(recording, sensor)
    design = _checked_design(recording, position, drift_order, harmonics)
    # What is fitted is what is left of a line, so that long travel costs no digits.
    line = (position[-1] - position[0]) / (recording.phase[-1] - recording.phase[0] or 1)
    fit = _solved(design, position, line, recording.label)
    noise = _noise(design, position, line, fit)
    order = design.order
    cosines, sines = fit.solution[-2 * order : -order], fit.solution[-order:]
    turns = TURN / design.half_span
    return Response(
        step_size=float(line * TURN + fit.solution[1] * turns),
        harmonics=cosines - 1j * sines,
        standard_errors=_standard_errors(design, fit, noise),
        unit=recording.units[sensor],
        estimator="least_squares",
        step_size_standard_error=_step_standard_error(design, fit, noise),
    )


def _residuals(
    design: Design, position: FloatArray, line: float, fit: Fit | None
) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
    """Yield stretch, rows, and what position leaves of the line, and of the fit if there is one."""
    for chunk in design.chunks():
        rows = design.rows(chunk)
        left = position[chunk] - position[0] - line * (design.phase[chunk] - design.phase[0])
        yield chunk, rows, left if fit is None else left - rows @ fit.solution


def _solved(design: Design, position: FloatArray, line: float, label: str) -> Fit:
    """Solve the normal equations, columns scaled to one length; EstimationError if singular."""
    normal = np.zeros((design.unknowns, design.unknowns))
    moment = np.zeros(design.unknowns)
    for _, rows, left in _residuals(design, position, line, None):
        normal += rows.T @ rows
        moment += rows.T @ left
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    if values[0] < LEAST_EIGENVALUE:
        raise EstimationError(
            f"{label}: the phases recorded do not determine {design.order} harmonics and a drift "
            f"of order {design.drift_order}; ask for fewer, or record more cycles"
        )
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return Fit(inverse @ moment, inverse)


def _noise(design: Design, position: FloatArray, line: float, fit: Fit) -> Noise:
    """Return the noise that the fit leaves between the harmonics, or all in one level."""
    lowest, squares, samples = design.phase.min(), 0.0, 0
    cells_a_cycle = 2 ** math.ceil(math.log2(16 * design.order))
    cycles = max(1, min(int(design.half_span / np.pi + 1e-6), CELLS // cells_a_cycle))
    cells = np.zeros(cycles * cells_a_cycle)
    for chunk, _, left in _residuals(design, position, line, fit):
        numbers = ((design.phase[chunk] - lowest) / TURN * cells_a_cycle).astype(np.int64)
        inside = numbers < len(cells)
        cells += np.bincount(numbers[inside], left[inside], len(cells))
        samples += int(inside.sum())
        squares += float(left @ left)
    found = residual_noise(cells, cycles, samples, design.order, design.drift_order)
    freedom = len(position) - design.unknowns
    return found or Noise(squares / freedom, 0.0, np.ones(design.order + 1))


def _standard_errors(design: Design, fit: Fit, noise: Noise) -> FloatArray:
    """Return the standard deviation of a quadrature of each harmonic: local noise power there."""
    order = design.order
    orders = np.arange(1.0, order + 1)
    gain = squared_gain(orders * _cycles_a_sample(design))
    power = (noise.white + noise.walk / gain) * noise.excess[1:]
    variances = np.diag(fit.inverse)
    mean = (variances[-2 * order : -order] + variances[-order:]) / 2
    return np.asarray(np.sqrt(power * mean))


def _step_standard_error(design: Design, fit: Fit, noise: Noise) -> float:
    """Return the standard deviation of the step size.

    A walk counts by its travel from end to end; the fifth more that a line costs is in its level.
    """
    white = noise.white * float(fit.inverse[1, 1]) * (TURN / design.half_span) ** 2
    walk = noise.walk * len(design.phase) * (np.pi / design.half_span) ** 2
    return float(np.sqrt((white + walk) * noise.excess[0]))


def _cycles_a_sample(design: Design) -> float:
    return design.half_span / (np.pi * len(design.phase))


def _legendre(unit_time: FloatArray, drift_order: int) -> FloatArray:
    """Return P_2 .. P_drift_order of times in [-1, 1], shape (samples, drift_order - 1)."""
    return np.asarray(np.polynomial.legendre.legvander(unit_time, drift_order)[:, 2:])


def _checked_design(
    recording: Recording, position: FloatArray, drift_order: int, harmonics: int | None
) -> Design:
    """Return what to fit; EstimationError if the recording cannot determine it."""
    columns = {"phase": recording.phase, "time": recording.time, "position": position}
    for name, values in columns.items():
        if not np.isfinite([values.min(initial=0), values.max(initial=0)]).all():
            raise not_finite(recording, values, name)
    cycles = float(np.ptp(recording.phase)) / TURN if len(position) else 0.0
    if cycles < 1 - 1e-6:
        raise EstimationError(f"{recording.label}: {cycles:.3g} cycles recorded; at least 1 needed")
    default = min(int(len(position) / cycles) // 4, MOST_DEFAULT_HARMONICS)
    order = max(default, 1) if harmonics is None else harmonics
    design = Design(recording.phase, recording.time, order, drift_order)
    if len(position) <= design.unknowns:
        raise EstimationError(
            f"{recording.label}: {len(position)} samples cannot determine {design.unknowns} "
            f"unknowns ({order} harmonics, drift of order {drift_order}); ask for fewer"
        )
    if design.drifts and not np.ptp(recording.time) > 0:
        raise EstimationError(f"{recording.label}: no time passes, so no drift can be fitted")
    return design
