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


def apply_to_rows(A: LinearOperator, X: Array) -> Array:
    """Return `A` times each row of `X`, without the checks of ``A @ x``.

    Parameters
    ----------
    A : LinearOperator of shape (n, n)
        Any operator, of this package or not.
    X : ndarray of shape (n,) or (k, n)

    Returns
    -------
    ndarray of the shape of `X`

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse.linalg import aslinearoperator
    >>> A = aslinearoperator(np.array([[1.0, 2.0], [3.0, 4.0]]))
    >>> apply_to_rows(A, np.array([[1.0, 0.0], [0.0, 1.0]]))
    array([[1., 3.],
           [2., 4.]])
    """
    # An operator that the user made from functions may return (n, 1) or an np.matrix.
    if X.ndim == 1:
        return np.asarray(A._matvec(X)).reshape(X.shape)
    return np.asarray(A._matmat(X.T)).T
