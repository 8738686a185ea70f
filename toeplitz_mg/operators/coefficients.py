"""Coefficients of a Toeplitz matrix: what they must be, for its products to be right."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toeplitz_mg.values import unmasked

Array = NDArray[Any]

HEADROOM = 2.0**-8  # of the largest number, for a row: the rest is for the sums of its products


def checked_coefficients(values: ArrayLike, name: str) -> Array:
    """Return `values` as a float array, or say what is wrong with them."""
    array = unmasked(name, values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but coefficients are real numbers")
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    if array.ndim == 0 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}, but needs at least one coefficient")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0]
        at = tuple(int(k) for k in where)
        raise ValueError(f"{name} has the coefficient {array[at]} at {at}, but all must be finite")
    _require_digits(name, np.abs(array))
    return array


def _require_digits(name: str, sizes: Array) -> None:
    """Raise ValueError where coefficients of these sizes make products over- or underflow."""
    numbers = np.finfo(sizes.dtype)
    with np.errstate(over="ignore"):  # to inf, which is too much
        total = float(sizes.sum(dtype=np.float64))
    most = float(numbers.max) * HEADROOM / 2**sizes.ndim
    if total > most:
        raise ValueError(
            f"{name} has coefficients whose sizes add up to {total:.3g}, but must be at most "
            f"{most:.3g} so that no product overflows: divide the matrix, and what it is to give, "
            "by a number"
        )
    # Some eigenvalue is as large. A product has it divided by the length of the transforms.
    largest, least = float(sizes.max()), float(numbers.tiny) * 2 ** (sizes.ndim + 1) * sizes.size
    if 0.0 < largest < least:
        raise ValueError(
            f"{name} has coefficients of size {largest:.3g} at most, but must have one of "
            f"{least:.3g} so that no product loses digits: multiply the matrix, and what it is to "
            "give, by a number"
        )
