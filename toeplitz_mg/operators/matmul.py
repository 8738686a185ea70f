"""Drop-in replacement for `scipy.linalg.matmul_toeplitz`."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.toeplitz import ToeplitzOperator
from toeplitz_mg.values import refuse_masked


def matmul_toeplitz(
    c_or_cr: Any, x: ArrayLike, check_finite: bool = False, workers: int | None = None
) -> Array:
    """Multiply a Toeplitz matrix and vectors: drop-in for `scipy.linalg.matmul_toeplitz`.

    Parameters
    ----------
    c_or_cr : array_like of shape (..., m), or tuple (c, r) of such
        First column, or first column and first row, of shape (..., n); r[0] is ignored. Without r
        it is the conjugate of c. Leading dimensions are a batch, as in SciPy.
    x : array_like of shape (n,) or (..., n, k)
    check_finite : bool
        Whether to raise an error for NaN and infinities; if false, the product has NaN.
    workers : int, optional
        Maximum number of threads, as in `scipy.fft`.

    Returns
    -------
    ndarray of shape (m,) or (..., m, k)

    Raises
    ------
    ValueError
        For shapes that do not match, and with `check_finite` for numbers that are not finite.
    TypeError
        If an argument is not numeric.

    See Also
    --------
    ToeplitzOperator : faster for several products with the same matrix.
    scipy.linalg.matmul_toeplitz

    Examples
    --------
    >>> from toeplitz_mg import matmul_toeplitz
    >>> matmul_toeplitz(([1.0, 2.0, 3.0], [1.0, 5.0]), [1.0, 1.0]).round(12)
    array([6., 3., 5.])
    """
    c, r = c_or_cr if isinstance(c_or_cr, tuple) else (c_or_cr, None)
    c = _numbers("c", c)
    r = np.conj(c) if r is None else _numbers("r", r)
    X = _numbers("x", x)
    if 0 in (c.ndim, r.ndim, X.ndim):
        raise ValueError("c, r and x must have one axis at least, but one of them is a number")
    is_vector = X.ndim == 1
    X = X[:, np.newaxis] if is_vector else X
    (m, n), k = (c.shape[-1], r.shape[-1]), X.shape[-1]
    if X.shape[-2] != n:
        raise ValueError(
            f"x has shape {np.shape(x)}, but must have {n} rows: the matrix has shape {(m, n)}"
        )
    if check_finite and not all(np.isfinite(a).all() for a in (c, r, X)):
        raise ValueError("c, r or x has numbers that are not finite, but all must be")
    batch = np.broadcast_shapes(c.shape[:-1], r.shape[:-1], X.shape[:-2])
    dtype = np.result_type(c, r, X, np.float32)
    Y = np.zeros((prod(batch), m, k), dtype)
    parts = (
        np.broadcast_to(a, batch + a.shape[a.ndim - d :]).reshape((-1, *a.shape[a.ndim - d :]))
        for a, d in ((c, 1), (r, 1), (X, 2))
    )
    with fft.set_workers(fft.get_workers() if workers is None else workers):
        for y, *part in zip(Y, *parts, strict=True) if Y.size else ():
            y[...] = _multiply(*part)
    Y = Y.reshape((*batch, m, k))
    return Y[..., 0] if is_vector else Y


def _multiply(c: Array, r: Array, X: Array) -> Array:
    """Multiply one matrix with the columns of X."""
    r = np.concatenate([c[:1], r[1:]])
    if not (np.isfinite(c).all() and np.isfinite(r).all()):
        return np.full((len(c), X.shape[1]), np.nan)
    A = ToeplitzOperator(c, r)
    return A @ X if X.shape[1] > 1 else (A @ X[:, 0])[:, np.newaxis]


def _numbers(name: str, values: Any) -> Array:
    """Return an array of numbers; integers are converted to double precision."""
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buifc" and array.size:
        raise TypeError(f"{name} has dtype {array.dtype}, but must be of numbers")
    return (
        array
        if array.dtype.char in "fdFD"
        else array.astype(np.complex128 if array.dtype.kind == "c" else np.float64)
    )
