"""The matrix of steady rolling as an array."""

from functools import cached_property
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import VECTORS
from toeplitz_mg.engine.work import count_work

LEAST_UNIT, MOST_UNIT = 1e-12, 1e12  # Diagonals of a matrix that single precision is good for.


class SteadyArray:
    """The matrix of steady rolling on the elements in contact, as an array.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
    contact : ndarray of bool
        The elements in contact: the fields of these are one axis.

    Attributes
    ----------
    array : ndarray
        In double precision.
    """

    vectors = VECTORS

    def __init__(self, K: Any, contact: Array) -> None:
        m = K.shape[0] // contact.size
        self.array = K.block(np.flatnonzero(np.tile(contact.ravel(), m)))
        # In single precision, where its range is that of the numbers.
        is_single = LEAST_UNIT < self.array[0, 0] < MOST_UNIT
        self._rough = self.array.astype(np.float32) if is_single else self.array
        self._rough_inverse = np.linalg.inv(self._rough)
        for array in (self.array, self._rough, self._rough_inverse):
            array.flags.writeable = False

    @cached_property
    def _inverse(self) -> Array:
        inverse = np.linalg.inv(self.array)
        inverse.flags.writeable = False
        return inverse

    def choose(self, *, inverse: bool, precisely: bool) -> Array:
        """Return the matrix, or its inverse, in double precision or in single."""
        if precisely:
            return self._inverse if inverse else self.array
        return self._rough_inverse if inverse else self._rough

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply a field of the elements in contact."""
        count_work(1, X.size)
        return self.array @ X

    def solve(self, u: Array) -> Array:
        """Return the tractions that have these displacements in a step, to some 10 digits."""
        rough: Array = self._rough_inverse @ u.astype(self._rough.dtype)
        q = rough.astype(np.float64)
        return q + self._rough_inverse @ (u - self.array @ q).astype(self._rough.dtype)
