"""The symbol of A, sampled: its coefficients are continued smoothly, not cut off."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from toeplitz_mg.operators import ToeplitzOperator

Array = NDArray[Any]


def sampled_symbol(A: ToeplitzOperator, shape: tuple[int, ...]) -> Array:
    """The symbol at θ = πk/n, k = 0 … n in each level, n of `shape`."""
    column = A.c.astype(np.float64)
    if not A.is_even:  # its even part, as the transforms have no other
        flips = _flips(A.lags.astype(np.float64))
        column = np.mean(flips, axis=0)[tuple(slice(n - 1, None) for n in A.grid_shape)]
    for level, n in enumerate(shape):
        column = _continued(column, level, n)
    # Σ over all lags of a_k cos kθ, by symmetry a cosine transform of the first column.
    return np.asarray(fft.dctn(column, type=1))


def _flips(lags: Array) -> list[Array]:
    arrays = [lags]
    for level in range(lags.ndim):
        arrays += [np.flip(array, level) for array in arrays]
    return arrays


def _continued(column: Array, level: int, n: int) -> Array:
    """Continue a level to the lags 0 … n: a coefficient that is not there is not zero.

    By the parabola that goes on with the slope of the last two and is flat at lag n.
    """
    known = column.shape[level]
    last = np.take(column, [-1], axis=level)
    if known == 1:  # one element: it has no other lags
        return np.concatenate([column, np.zeros_like(last)], axis=level)
    slope = last - np.take(column, [-2], axis=level)
    ahead = n - known + 1  # steps from the last coefficient to lag n
    t = np.arange(1.0, ahead + 1).reshape([-1 if k == level else 1 for k in range(column.ndim)])
    return np.concatenate([column, last + slope * t * (1.0 - t / (2.0 * ahead))], axis=level)
