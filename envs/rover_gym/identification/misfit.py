"""Whether noise of the sensors explains what a fit leaves.

If no noise is given, it is estimated from the residuals, which also hold what the simulation gets wrong: a fit in which
the wheels hold while the recorded ones spin then takes its errors for noise. The rows themselves bound the noise from
above: independent noise of standard deviation s gives third differences of standard deviation sqrt(20) s, and motion
only adds to them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rover_gym.identification.windows import Window

Array = npt.NDArray[np.float64]

#: A column that is missed by more than this many standard deviations of its noise, in half of the windows, is not
#: explained.
EXPLAINED = 3.0
#: Median of the absolute value of a normal variable over its standard deviation, inverted.
FROM_MEDIAN = 1.4826


def roughness(windows: Sequence[Window]) -> Array:
    """(nq + nv,) standard deviations of noise that would make the rows of the windows as rough as they are."""
    differences = [np.diff(window.measured, n=3, axis=0) for window in windows]
    rows = np.concatenate(differences)
    if not len(rows):
        return np.zeros(rows.shape[1])
    bound: Array = FROM_MEDIAN * np.median(np.abs(rows), axis=0) / np.sqrt(20.0)
    return bound


def not_explained(windows: Sequence[Window], residuals: Array, least: Array) -> tuple[Array, Array]:
    """How far a fit is from the rows, by columns, and how far noise may be.

    Args:
        windows: The windows, of n rows in all.
        residuals: (n, nq + nv) simulated minus measured.
        least: (nq + nv,) noise that is taken for possible in any case.

    Returns:
        (nq + nv,) root mean square of the residuals in the median window, and its bound.
    """
    ends = np.cumsum([window.measured.shape[0] for window in windows])[:-1]
    missed = [np.sqrt(np.mean(rows**2, axis=0)) for rows in np.split(residuals, ends)]
    return np.median(missed, axis=0), EXPLAINED * np.maximum(roughness(windows), least)
