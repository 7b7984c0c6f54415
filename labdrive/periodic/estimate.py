"""Estimators: from a recording to the response of the actuator."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from labdrive.model.arrays import ComplexArray, FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import TURN
from labdrive.periodic.checks import not_finite, readings_of
from labdrive.periodic.fold import Fold, fold
from labdrive.periodic.least_squares import least_squares
from labdrive.periodic.noise import Noise, equidistant_noise, squared_gain
from labdrive.periodic.response import Response

Estimator = Literal["exact", "paper", "least_squares"]
# Phases are looked at in so many places: a pass over all of them would double the cost.
PHASES_CHECKED = 1024


def estimate(
    recording: Recording,
    sensor: str,
    estimator: Estimator = "exact",
    drift_order: int = 1,
    harmonics: int | None = None,
) -> Response:
    """Return the response of the actuator that `sensor` saw.

    `exact` and `paper` fold equidistant samples over whole cycles, as the paper's appendix does.
    `paper` is the printed formula, which integrates by 1/(i k) and so shrinks harmonic k by
    sinc(k/m); `exact` divides by exp(i k 2 pi/m) - 1, the transfer function of a difference.
    `least_squares` fits the real phases of any recording, with a drift of `drift_order` in time;
    the others ignore that. `harmonics` is the highest one wanted, all that there are by default.

    EstimationError if the recording does not hold what the estimator needs.
    """
    if estimator == "least_squares":
        return least_squares(recording, sensor, drift_order, harmonics)
    return _differenced(recording, sensor, estimator, harmonics)


def _differenced(
    recording: Recording, sensor: str, estimator: Estimator, harmonics: int | None
) -> Response:
    """Return the response by differences folded over cycles."""
    m = recording.samples_per_period
    _check_equidistant(recording)
    order = _checked_order(recording, harmonics)
    position = readings_of(recording, sensor)
    folded = fold(position, m)
    if not (np.isfinite(folded.sums).all() and np.isfinite(folded.travel)):
        raise not_finite(recording, position, sensor)
    noise = equidistant_noise(position, m, order)
    orders = np.arange(1, order + 1)
    shrinking = np.sinc(orders / m) if estimator == "paper" else np.ones(order)
    return Response(
        step_size=folded.step * _sense(recording),
        harmonics=shrinking * _real_phase(_coefficients(folded, orders), orders, recording),
        standard_errors=shrinking * _standard_errors(noise, orders, folded.cycles, m),
        unit=recording.units[sensor],
        estimator=estimator,
        step_size_standard_error=_step_standard_error(noise, folded.cycles, m),
        noise_bins=noise.bins,
    )


def _coefficients(folded: Fold, orders: NDArray[np.int64]) -> ComplexArray:
    """Return D_k of sum Re(D_k exp(i k 2 pi j/m)), j the number of the sample."""
    m = len(folded.sums)
    transform = np.fft.rfft(folded.differences)[orders] / folded.cycles
    return np.asarray(transform * 2 / (m * np.expm1(1j * TURN * orders / m)))


def _real_phase(
    coefficients: ComplexArray, orders: NDArray[np.int64], recording: Recording
) -> ComplexArray:
    """Return C_k over the commanded phase, of D_k over sample numbers from the first phase on."""
    if _sense(recording) < 0:
        coefficients = coefficients.conj()
    return np.asarray(coefficients * np.exp(-1j * orders * recording.phase[0]))


def _standard_errors(noise: Noise, orders: NDArray[np.int64], cycles: int, m: int) -> FloatArray:
    """Return the standard deviation of a quadrature of each harmonic.

    Differencing leaves the two end positions with weights 1/(1 - exp(i k 2 pi/m)): white noise
    costs a little more than in least squares, a random walk nothing beyond what it must.
    """
    samples = cycles * m
    gain = squared_gain(orders / m)
    white = 2 * noise.white / samples * (1 + (2 / gain - 1) / samples)
    walk = 2 * _true_walk(noise, cycles) / (samples * gain)
    return np.asarray(np.sqrt((white + walk) * noise.excess[orders]))


def _step_standard_error(noise: Noise, cycles: int, m: int) -> float:
    """Return the standard deviation of the slope of a line through the means of n cycles."""
    white = 12 * noise.white / (m * cycles * (cycles**2 - 1))
    walk = noise.walk * m / cycles
    return float(np.sqrt((white + walk) * noise.excess[0]))


def _true_walk(noise: Noise, cycles: int) -> float:
    """Return the walk's gain a sample: a line through cycle means shows so much more of it."""
    return noise.walk * (cycles**2 - 1) / (1.2 * cycles**2 - 0.8)


def _sense(recording: Recording) -> int:
    """Return +1 where the recorded phase rises, -1 where it falls."""
    return 1 if recording.phase[-1] >= recording.phase[0] else -1


def _checked_order(recording: Recording, harmonics: int | None) -> int:
    """Return the highest harmonic to estimate, the one at half the sampling rate excluded."""
    most = (recording.samples_per_period - 1) // 2
    order = most if harmonics is None else harmonics
    if not 1 <= order <= most:
        raise EstimationError(
            f"{recording.label}: {recording.samples_per_period} samples a cycle hold harmonics "
            f"1 to {most}, but {order} were asked for; ask for fewer or sample more often"
        )
    return order


def _check_equidistant(recording: Recording) -> None:
    """EstimationError unless the samples are triggered, over two or more whole cycles."""
    m, samples = recording.samples_per_period, len(recording.phase)
    if samples <= 2 * m:
        raise EstimationError(
            f"{recording.label}: {samples} samples are less than two cycles of {m} and one more, "
            "too few to tell noise from periodic error; record more cycles"
        )
    if recording.sampling is not Sampling.TRIGGERED:
        fault = "the samples were polled, so their phases are not equidistant"
    elif (samples - 1) % m:
        fault = f"{samples} samples are not a whole number of cycles of {m} and one more"
    elif not _equidistant(recording.phase, _sense(recording) * TURN / m):
        fault = f"the phases are not equidistant by 2 pi/{m}"
    else:
        return
    raise EstimationError(f"{recording.label}: {fault}; use the estimator least_squares")


def _equidistant(phase: FloatArray, step: float) -> bool:
    """Return whether phases, ends and a bounded number between, lie on the grid they claim."""
    numbers = np.linspace(0, len(phase) - 1, min(len(phase), PHASES_CHECKED)).astype(np.int64)
    off = phase[numbers] - phase[0] - step * numbers
    return bool(np.all(np.abs(off) < 1e-3 * abs(step)))
