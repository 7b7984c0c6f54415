"""Least squares on the real phases: for polled, jittered or gapped recordings of any span."""

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.errors import EstimationError
from labdrive.model.recording import Recording
from labdrive.model.waveform import TURN
from labdrive.periodic.checks import not_finite, readings_of
from labdrive.periodic.noise import Noise
from labdrive.periodic.regression import Fit, Regression
from labdrive.periodic.response import Response

MOST_DEFAULT_HARMONICS = 64


def least_squares(
    recording: Recording, sensor: str, drift_order: int, harmonics: int | None
) -> Response:
    """Return the response fitted to the real phases, with a drift of `drift_order` in time.

    By default there are as many harmonics as a quarter of the samples in a cycle, 64 at most.

    EstimationError for values that are not finite, less than a cycle, fewer samples than
    unknowns, or phases that leave some unknown undetermined.
    """
    regression = _checked(recording, sensor, drift_order, harmonics)
    try:
        fit = regression.fit()
    except EstimationError as error:
        raise EstimationError(f"{recording.label}: {error}") from error
    noise = regression.noise(fit)
    return Response(
        step_size=regression.step_size(fit),
        harmonics=regression.harmonics(fit),
        standard_errors=_standard_errors(regression, fit, noise),
        unit=recording.units[sensor],
        estimator="least_squares",
        step_size_standard_error=_step_standard_error(regression, fit, noise),
        noise_bins=noise.bins,
    )


def _standard_errors(regression: Regression, fit: Fit, noise: Noise) -> FloatArray:
    """Return the standard deviation of a quadrature of each harmonic."""
    order, variances = regression.order, np.diag(fit.inverse)
    mean = (variances[-2 * order : -order] + variances[-order:]) / 2
    return np.asarray(np.sqrt(regression.noise_at_harmonics(noise) * mean))


def _step_standard_error(regression: Regression, fit: Fit, noise: Noise) -> float:
    """Return the standard deviation of the step size.

    A walk counts by its travel from end to end; the fifth more that a line costs is in its level.
    """
    white = noise.white * float(fit.inverse[1, 1]) * (TURN / regression.half_span) ** 2
    walk = noise.walk * len(regression.phase) / regression.cycles**2
    return float(np.sqrt((white + walk) * noise.excess[0]))


def _checked(
    recording: Recording, sensor: str, drift_order: int, harmonics: int | None
) -> Regression:
    """Return what to fit; EstimationError if the recording cannot determine it."""
    position = readings_of(recording, sensor)
    columns = (("phase", recording.phase), ("time", recording.time), (sensor, position))
    for name, values in columns:
        if not np.isfinite([values.min(initial=0), values.max(initial=0)]).all():
            raise not_finite(recording, values, name)
    cycles = float(np.ptp(recording.phase)) / TURN if len(position) else 0.0
    if cycles < 1 - 1e-6:
        raise EstimationError(f"{recording.label}: {cycles:.3g} cycles recorded; at least 1 needed")
    default = min(int(len(position) / cycles) // 4, MOST_DEFAULT_HARMONICS)
    order = max(default, 1) if harmonics is None else harmonics
    if order < 1:
        raise EstimationError(f"{recording.label}: {order} harmonics asked for; at least 1 needed")
    found = Regression(recording.phase, recording.time, position, order, drift_order)
    if len(position) <= found.unknowns:
        raise EstimationError(
            f"{recording.label}: {len(position)} samples cannot determine {found.unknowns} "
            f"unknowns ({order} harmonics, drift of order {drift_order}); ask for fewer"
        )
    if found.drifts and not np.ptp(recording.time) > 0:
        raise EstimationError(f"{recording.label}: no time passes, so no drift can be fitted")
    return found
