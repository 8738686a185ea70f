"""What the iterations ask of their input."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


def checked_vector(values: ArrayLike, name: str, n: int) -> Array:
    """Return a vector of shape (n,) of finite numbers, or say what is wrong with it."""
    array = np.asarray(values)
    if array.dtype.kind not in "buifc":
        raise TypeError(f"{name} has dtype {array.dtype}, but must be of numbers")
    if array.shape not in ((n,), (n, 1)):
        raise ValueError(f"{name} has shape {array.shape}, but A has {(n, n)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has entries that are not finite")
    if array.dtype.kind in "bui" or array.dtype == np.float16:
        array = array.astype(np.float64)
    return array.reshape(n)


def require_tolerances(rtol: float, atol: float) -> None:
    """Raise ValueError where a tolerance makes no sense."""
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if not 0.0 <= tolerance < np.inf:
            raise ValueError(f"{name} is {tolerance}, but must be finite and not negative")
