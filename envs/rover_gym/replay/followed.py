"""The path that the eye of a page follows."""

import numpy as np
import numpy.typing as npt

FOLLOW_TIME = 1.0  # s, smoothing window

Array = npt.NDArray[np.float64]


def smoothed(time: Array, path: Array) -> Array:
    """A path `(n, d)` as its mean over the samples within half of `FOLLOW_TIME` s, so that the eye does not shake."""
    spans = np.abs(time[:, None] - time) <= FOLLOW_TIME / 2
    result: Array = spans @ path / spans.sum(axis=1, keepdims=True)
    return result
