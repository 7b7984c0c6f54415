"""Thin a curve for plotting so that no extreme is lost."""

from itertools import pairwise

import numpy as np

from labdrive.model.arrays import FloatArray


def decimate(x: FloatArray, y: FloatArray, buckets: int) -> tuple[FloatArray, FloatArray]:
    """Return at most two points a bucket: where y is least and where it is most, in order.

    `x` and `y` have shape (samples,); up to 2 `buckets` samples are returned as they are.
    """
    if len(y) <= 2 * buckets:
        return x, y
    edges = np.linspace(0, len(y), buckets + 1).astype(np.int64)
    kept = set()
    for start, stop in pairwise(edges):
        bucket = y[start:stop]
        kept |= {int(start + np.argmin(bucket)), int(start + np.argmax(bucket))}
    order = np.array(sorted(kept))
    return x[order], y[order]
