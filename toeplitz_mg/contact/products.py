"""Products with fields on a grid, counted."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import apply_to_rows

Array = NDArray[Any]


class Products:
    """Products of an operator with fields of any shape.

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

    @property
    def exhausted(self) -> bool:
        """Whether no more products should be made."""
        return self.count >= self.limit

    def __call__(self, x: Array) -> Array:
        """Multiply a field, of as many numbers as the operator has unknowns."""
        self.count += 1
        return np.asarray(apply_to_rows(self.A, x.reshape(-1))).reshape(x.shape)
