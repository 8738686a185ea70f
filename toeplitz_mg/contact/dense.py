"""Matrices for few elements in contact, stored as arrays."""

from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import VECTORS
from toeplitz_mg.engine.work import count_work
from toeplitz_mg.operators import CoupledOperator

LEAST_UNIT, MOST_UNIT = 1e-12, 1e12  # Range of diagonals for single precision.


def precision_for(unit: float) -> type[np.floating[Any]]:
    """Return single precision if the diagonal of a matrix is in its range, else double."""
    return np.float32 if LEAST_UNIT < unit < MOST_UNIT else np.float64


class DenseMatrix:
    """The rows and columns of a matrix for the elements in contact, as an array.

    Fields on these elements have one axis.
    """

    vectors = VECTORS

    def __init__(self, K: Any, contact: Array) -> None:
        blocks = K.blocks if isinstance(K, CoupledOperator) else [[K]]
        m = np.count_nonzero(contact)
        self.array = np.zeros((len(blocks) * m, len(blocks) * m))
        # The index of a lag is the difference of the indices of two elements in the grid of lags.
        number = np.ravel_multi_index(contact.nonzero(), [2 * n - 1 for n in contact.shape])
        lag = np.subtract.outer(number, number)
        for i, row in enumerate(blocks):
            for j, block in enumerate(row):
                if block is not None:
                    lags = block.lags.ravel()
                    self.array[i * m :, j * m :][:m, :m] = lags[lag + len(lags) // 2]
        self._rough_inverse = _invert(self.array.astype(precision_for(self.array[0, 0])))
        for array in (self.array, self._rough_inverse):
            array.flags.writeable = False

    @cached_property
    def _inverse(self) -> Array:
        inverse = _invert(self.array)
        inverse.flags.writeable = False
        return inverse

    def inverse(self, *, precisely: bool) -> Array:
        """Return the inverse, in double or single precision."""
        return self._inverse if precisely else self._rough_inverse

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply a field on the elements in contact."""
        count_work(1, X.size)
        return self.array @ X

    def solve(self, u: Array) -> Array:
        """Return the tractions that cause these displacements in a step, to some 10 digits."""
        q = np.zeros(len(u))
        for _ in range(2):
            rest = (u - self.array @ q).astype(self._rough_inverse.dtype)
            q += self._rough_inverse @ rest
        return q


def _invert(A: Array) -> Array:
    """Return the inverse, in a third of the time of `numpy.linalg.inv`."""
    getrf, getri, getri_lwork = get_lapack_funcs(("getrf", "getri", "getri_lwork"), (A,))
    factors, pivots, _ = getrf(A.T)
    size, _ = getri_lwork(len(A))
    inverse, _ = getri(factors, pivots, lwork=int(size), overwrite_lu=True)
    result: Array = inverse.T
    return result
