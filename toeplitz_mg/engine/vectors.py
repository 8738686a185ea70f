"""Inner products and updates of vectors, part by part, for all iterations.

For a long vector BLAS takes as many threads as it has, which wait for each other, and then for more
to do on the cores that the products need. So it is given parts that are too short for that. The
operations of NumPy's own that are not here, as ``x *= a``, use one thread anyway.

A vector may be a field of any shape. The sums of its parts are added in double precision.
"""

from functools import cache
from math import hypot
from typing import Any

import numpy as np
from scipy.linalg import get_blas_funcs

from toeplitz_mg._typing import Array

PART = 2**13  # Numbers of a part: OpenBLAS shares a vector of more than 10,000 among threads.


def dot(x: Array, y: Array) -> float:
    """Return the inner product of two real vectors."""
    if x.ndim == 1 and len(x) <= PART:
        return float(x @ y)
    return float(dots(x[None], y)[0])


def dots(X: Array, y: Array) -> Array:
    """Return the inner products of the vectors along the first axis of X with another.

    Parameters
    ----------
    X : ndarray of shape (k, ...)
    y : ndarray of shape (...)

    Returns
    -------
    ndarray of shape (k,)
    """
    rest: Any = 0.0
    if y.shape[-1] > PART:
        X, y = X.reshape(len(X), -1), y.reshape(-1)
        n = y.size // PART * PART
        rest = np.vecdot(X[:, n:], y[n:])
        X, y = X[:, :n].reshape(len(X), -1, PART), y[:n].reshape(-1, PART)
    # The sum of rows has a smaller rounding error than that over all of a field at once.
    return np.vecdot(X, y).reshape(len(X), -1).sum(axis=1, dtype=np.float64) + rest


def norm(x: Array) -> float:
    """Return the 2-norm of a vector, real or complex; no square of a number over- or underflows."""
    if x.ndim > 1:
        x = x.reshape(-1)
    nrm2 = _blas("nrm2", x.dtype.char)
    if x.size <= PART:
        return float(nrm2(x))
    return hypot(*(nrm2(x[k : k + PART]) for k in range(0, x.size, PART)))


def axpy(a: float, x: Array, y: Array) -> None:
    """Add a x to y, in place.

    Parameters
    ----------
    a : float
    x : ndarray
    y : ndarray of the shape and the dtype of `x`
        It is changed, and must be C-contiguous.
    """
    if not y.flags.c_contiguous:
        raise ValueError("y is not C-contiguous, but is to be changed in place")
    if y.ndim > 1:
        x, y = x.reshape(-1), y.reshape(-1)
    add = _blas("axpy", y.dtype.char)
    if y.size <= PART:
        add(x, y, a=a)
        return
    for k in range(0, y.size, PART):
        add(x[k : k + PART], y[k : k + PART], a=a)


def combine(weights: Array, X: Array) -> Array:
    """Return the sum of the vectors along the first axis of X with these weights.

    Parameters
    ----------
    weights : ndarray of shape (k,)
    X : ndarray of shape (k, ...)

    Returns
    -------
    ndarray of shape (...), of the dtype of `X`
    """
    # This is done without BLAS, and so without its threads.
    return np.einsum("k,k...->...", weights.astype(X.dtype), X)


@cache
def _blas(name: str, dtype: str) -> Any:
    return get_blas_funcs(name, dtype=dtype)
