"""The convention of every operator here: vectors are rows, on the last axis of an array."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

Array = NDArray[Any]


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
    An operator of this package has the method ``_apply(X, out=None)``, which is `_matvec` for
    rows that writes where it is told to, so that nothing large is allocated.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import aslinearoperator
    >>> A = aslinearoperator(np.array([[1.0, 2.0], [3.0, 4.0]]))
    >>> apply_to_rows(A, np.array([[1.0, 0.0], [0.0, 1.0]]))
    array([[1., 3.],
           [2., 4.]])
    """
    if (apply := getattr(A, "_apply", None)) is not None:
        return np.asarray(apply(X, out))
    # An operator that the user made from functions may return (n, 1) or an np.matrix.
    Y = np.asarray(A._matvec(X) if X.ndim == 1 else A._matmat(X.T).T).reshape(X.shape)
    if out is None:
        return Y
    out[...] = Y
    return out
