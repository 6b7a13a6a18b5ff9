"""What policies refuse to act on."""

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import StateError
from rover_gym.validation import refuse


def check_observed(given: npt.NDArray[Any], size: int) -> None:
    """Checks an observation `(size,)` or a batch of them `(n, size)`.

    Raises:
        StateError: It has a wrong shape or an entry that is not finite.
    """
    if given.ndim not in (1, 2) or given.shape[-1] != size:
        refuse(StateError, "observation", given.shape, f"must be (..., {size})")
    if not np.isfinite(given).all():
        refuse(StateError, "observation", given, "must be finite")
