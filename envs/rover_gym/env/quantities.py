"""Types of quantities for one rover or for n: a float, or an array with one entry per rover.

The same functions serve both. They spell out their arithmetic entry by entry, because NumPy's reductions and matrix
products round differently for different shapes. A rover's results are therefore bit-identical alone and in a batch.
"""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Observations: TypeAlias = npt.NDArray[np.float32]

#: A float for one rover, an array `(n,)` for n.
Quantity: TypeAlias = Any
