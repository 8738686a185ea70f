"""Products with fields on a grid, counted; and inner products, row by row.

BLAS shares a long vector among threads, that wait for each other longer than the work takes.
"""

from functools import cached_property

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import apply_to_rows


class Products:
    """Products of an operator with fields of any shape, in the precision of the field.

    Attributes
    ----------
    count : int
        Made so far.
    limit : int
        `exhausted` beyond so many.
    """

    def __init__(self, A: LinearOperator, limit: int) -> None:
        self.A = A
        self.count = 0
        self.limit = limit

    @cached_property
    def _single(self) -> LinearOperator:
        return self.A.astype(np.float32)

    @property
    def exhausted(self) -> bool:
        """Whether no more products should be made."""
        return self.count >= self.limit

    def __call__(self, x: Array) -> Array:
        """Multiply a field, of as many numbers as the operator has unknowns."""
        self.count += 1
        A = self._single if x.dtype == np.float32 else self.A
        return np.asarray(apply_to_rows(A, x.reshape(-1))).reshape(x.shape)


def dot(x: Array, y: Array) -> float:
    """The inner product of two fields."""
    return float(np.vecdot(x, y).sum())


def dots(X: Array, y: Array) -> Array:
    """The inner products of the fields along the first axis of X with another."""
    return np.asarray(np.vecdot(X, y).reshape(len(X), -1).sum(axis=1))


def combined(weights: Array, X: Array) -> Array:
    """The sum of the fields along the first axis of X with some weights."""
    return np.asarray(np.einsum("k,k...->...", weights.astype(X.dtype), X))
