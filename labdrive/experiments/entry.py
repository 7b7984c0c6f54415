"""A response as result.json tells it."""

from typing import Any

import numpy as np

from labdrive.model.recording import Recording
from labdrive.periodic.response import Response


def entry(response: Response, recording: Recording) -> dict[str, Any]:
    """Return the numbers of one recording: SI, in the sensor's unit; phases in rad.

    The error over the phase is sum_k amplitude cos(k phi + phase).
    """
    error = response.periodic_error
    return {
        "step_size": response.step_size,
        "step_size_standard_error": response.step_size_standard_error,
        "periodic_error": {"pv": error.pv, "rms": error.rms},
        "noise_floor": {"rms": response.noise_floor_rms},
        "harmonics": [
            {
                "k": k,
                "amplitude": float(abs(harmonic)),
                "phase": float(np.angle(harmonic)),
                "standard_error": float(standard_error),
            }
            for k, (harmonic, standard_error) in enumerate(
                zip(response.harmonics, response.standard_errors, strict=True), start=1
            )
        ],
        "label": recording.label,
        "recording": f"recordings/{recording.number:04d}.h5",
    }
