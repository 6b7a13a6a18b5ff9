"""Comparison of results to the last bit."""

from typing import Any

import numpy as np


def bits(result: Any) -> Any:
    """A result with every array as its type, shape and bytes, so that `==` compares bits."""
    if isinstance(result, dict):
        return {key: bits(value) for key, value in result.items()}
    if isinstance(result, tuple | list):
        return [bits(value) for value in result]
    if isinstance(result, np.ndarray):
        values = [bits(x) for x in result.ravel()] if result.dtype == object else result.tobytes()
        return result.dtype, result.shape, values
    return result
