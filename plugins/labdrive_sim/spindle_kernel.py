"""The compiled loop of a play: what follows lags by half the gap, whichever way it is pushed."""

import numba
import numpy as np

from labdrive.model.arrays import FloatArray


@numba.njit(cache=True)
def follow_with_play(pushed: FloatArray, radius: float, state: FloatArray) -> FloatArray:
    """Return where the follower is, shape (steps,); `state`, shape (1,), moves on.

    It rests while what pushes it moves by less than `radius` to either side. A state of NaN
    starts in the middle.
    """
    followed = np.empty(len(pushed))
    at = pushed[0] if np.isnan(state[0]) else state[0]
    for i in range(len(pushed)):
        at = max(pushed[i] - radius, min(pushed[i] + radius, at))
        followed[i] = at
    state[0] = at
    return followed
