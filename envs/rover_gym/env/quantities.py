"""Quantities of one rover or of n at once: a float, or an array with an entry a rover.

The same functions serve both. Their arithmetic is written out, entry by entry, since NumPy's reductions and products
round differently for different shapes. So a rover sees the same bits alone and among others.
"""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Observations: TypeAlias = npt.NDArray[np.float32]

#: A float for one rover, an array `(n,)` for n.
Quantity: TypeAlias = Any
