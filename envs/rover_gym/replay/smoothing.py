"""Means over a short time: of loads, and of the path that the eye of a page follows."""

import numpy as np
import numpy.typing as npt

FOLLOW_TIME = 1.0  # s, window of the path that the eye follows: the eye does not shake with the machine
LOAD_TIME = 0.2  # s, window of the loads: an impact lasts a step and says nothing of the weight carried

Array = npt.NDArray[np.float64]


def moving_mean(time: Array, values: Array, window: float) -> Array:
    """Values `(n, m)` averaged over the samples within half of a window, s, without those that are not finite."""
    half = 0.5 * window + 1e-6  # samples at the edge count, whatever their rounding
    first = np.searchsorted(time, time - half, side="left")
    last = np.searchsorted(time, time + half, side="right")
    known = np.isfinite(values)
    sums = np.vstack((np.zeros(values.shape[1]), np.cumsum(np.where(known, values, 0.0), axis=0)))
    counts = np.vstack((np.zeros(values.shape[1]), np.cumsum(known, axis=0)))
    with np.errstate(invalid="ignore"):
        result: Array = (sums[last] - sums[first]) / (counts[last] - counts[first])
    return result
