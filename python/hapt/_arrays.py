"""The check of arrays that a caller passes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def numbers(name: str, values: Any, least: int = 1) -> NDArray[np.float64]:
    """`values` as a contiguous one-dimensional array of float64.

    Raises TypeError where the elements are not real numbers; ValueError where the shape is not (n,), n is below `least`, an element is
    masked, or one is not finite.
    """
    if np.ma.is_masked(values):
        raise ValueError(f"{name}: elements are masked, but each must be a number: leave them out, or fill them in")
    try:
        array = np.asarray(values)
    except ValueError as error:  # Rows of different lengths.
        raise ValueError(f"{name}: an array of shape (n,) is expected: {error}") from None
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name}: real numbers are expected, not {array.dtype}")
    if array.ndim != 1 or array.size < least:
        raise ValueError(f"{name}: an array of shape (n,) with n >= {least} is expected, not of shape {array.shape}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    finite = np.isfinite(array)
    if not finite.all():
        index = int(np.argmin(finite))
        raise ValueError(f"{name}: element {index} is {array[index]}, but must be a finite number")
    return array
