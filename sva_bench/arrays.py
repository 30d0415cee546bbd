"""Array types, and arrays that cannot change under a frozen dataclass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def frozen(values: ArrayLike, shape: tuple[int | None, ...]) -> FloatArray:
    """A read-only float64 copy of ``values``, refused when NaN or of another shape.

    Args:
        values: Anything array-like.
        shape: Expected shape; ``None`` stands for any length.

    Raises:
        ValueError: If the shape differs or an entry is NaN.
    """
    array = np.array(values, dtype=np.float64)
    return _checked(array, shape)


def frozen_int(values: ArrayLike, shape: tuple[int | None, ...]) -> IntArray:
    """A read-only int64 copy of ``values``, refused when of another shape."""
    array = np.array(values, dtype=np.int64)
    return _checked(array, shape)


def _checked(array: NDArray[Any], shape: tuple[int | None, ...]) -> NDArray[Any]:
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise ValueError("NaN in an array")
    array.setflags(write=False)
    return array
