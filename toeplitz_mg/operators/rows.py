"""The convention of every operator here: vectors are rows, on the last axis of an array."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.values import unmasked

Array = NDArray[Any]

NUMBERS = "fcbui"  # the kinds of dtypes that are multiplied


def _vectors(x: Any) -> Any:
    """Return what an operator is multiplied with, or refuse what is no array of numbers."""
    if type(x) is np.ndarray and x.dtype.kind in NUMBERS:
        return x
    if isinstance(x, LinearOperator) or issparse(x):
        return x
    dtype = unmasked("x", x).dtype
    if dtype.kind not in NUMBERS:
        raise TypeError(f"x has dtype {dtype}, but must be of numbers")
    return x


def _of_numbers(name: str) -> Callable[[Any, Any], Any]:
    """Return a method of SciPy's operators that refuses what is no array of numbers."""
    method = getattr(LinearOperator, name)

    @wraps(method)
    def multiply(A: Any, x: Any) -> Any:
        return method(A, _vectors(x))

    return multiply


class RowsOperator(LinearOperator):
    """A real matrix, by its products with rows: the base of every operator of this package.

    A class says in ``_apply(X, out=None)`` what becomes of the rows of X, of shape (..., N): it is
    written to `out`, which may be X, or to a new array.
    """

    def _apply(self, X: Array, out: Array | None = None) -> Array:
        raise NotImplementedError

    def _matvec(self, x: Array) -> Array:
        return self._apply(as_rows(x, self.shape[1]))

    def _matmat(self, X: Array) -> Array:
        return np.asarray(self._apply(X.mT).mT)

    # SciPy takes the numbers below a mask, and anything that has a shape.
    dot = _of_numbers("dot")
    matvec = _of_numbers("matvec")
    matmat = _of_numbers("matmat")
    rmatvec = _of_numbers("rmatvec")
    rmatmat = _of_numbers("rmatmat")
    __rmul__ = _of_numbers("__rmul__")


def as_rows(x: Array, n: int) -> Array:
    """View `x` as rows of length `n`.

    SciPy before 1.18 hands a column of shape (n, 1) to ``_matvec`` as it is.
    """
    return x.reshape(n) if x.shape == (n, 1) != (1, 1) else x


def apply_to_rows(A: LinearOperator, X: Array, out: Array | None = None) -> Array:
    """Return `A` times each row of `X`, without the checks of ``A @ x``.

    Parameters
    ----------
    A : LinearOperator of shape (n, n)
        Any operator, of this package or not.
    X : ndarray of shape (n,) or (k, n)
    out : ndarray of the shape of `X`, optional
        Where the result is written. It may be `X`.

    Returns
    -------
    ndarray of the shape of `X`

    Notes
    -----
    An operator of this package writes where it is told to, so that nothing large is allocated.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import aslinearoperator
    >>> A = aslinearoperator(np.array([[1.0, 2.0], [3.0, 4.0]]))
    >>> apply_to_rows(A, np.array([[1.0, 0.0], [0.0, 1.0]]))
    array([[1., 3.],
           [2., 4.]])
    """
    if isinstance(A, RowsOperator):
        return A._apply(X, out)
    # An operator that the user made from functions may return (n, 1) or an np.matrix.
    Y = np.asarray(A._matvec(X) if X.ndim == 1 else A._matmat(X.T).T).reshape(X.shape)
    if out is None:
        return Y
    out[...] = Y
    return out
