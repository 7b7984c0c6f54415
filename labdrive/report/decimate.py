"""Thin a curve for plotting so that no extreme is lost."""

import numpy as np

from labdrive.model.arrays import FloatArray


def decimate(x: FloatArray, y: FloatArray, points: int) -> tuple[FloatArray, FloatArray]:
    """Return both ends, and of each stretch between the samples where y is least and most.

    `x` and `y` have shape (samples,); the results at most `points`, which must be 4 or more. What
    has no more samples than that is returned as it is.
    """
    if len(y) <= points:
        return x, y
    edges = np.linspace(0, len(y), points // 2).astype(np.int64)
    kept = {0, len(y) - 1}
    for start, stretch in zip(edges, np.split(y, edges[1:-1]), strict=False):
        kept |= {int(start + np.argmin(stretch)), int(start + np.argmax(stretch))}
    chosen = np.array(sorted(kept))
    return x[chosen], y[chosen]
