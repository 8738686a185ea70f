"""A part of the elements, where little else than zeros is to be computed on the others."""

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Mask, Multiply


class Whole:
    """All elements, in the place of a part: of vectors that are not worth to be cut."""

    def cut(self, x: Array) -> Array:
        """Return the field itself."""
        return x

    def put(self, part: Array, x: Array) -> Array:
        """Return the other field."""
        return part

    def restrict(self, multiply: Multiply, dtype: DTypeLike) -> Multiply:
        """Return what multiplies."""
        return multiply


class Part:
    """Some elements of a grid, whose fields are vectors of one axis.

    Products are with the whole grid. All else, as inner products, which would pass over fields
    that are mostly zero, is of these elements.
    """

    def __init__(self, elements: Mask) -> None:
        self._shape, self._index = elements.shape, np.flatnonzero(elements)

    def cut(self, x: Array) -> Array:
        """Return a field on these elements."""
        return np.take(x, self._index)

    def put(self, part: Array, x: Array) -> Array:
        """Return a field that is another one on these elements."""
        whole: Array = x.copy()
        whole.reshape(-1)[self._index] = part
        return whole

    def restrict(self, multiply: Multiply, dtype: DTypeLike) -> Multiply:
        """Return what multiplies fields as what multiplies those that are zero elsewhere."""
        field, memory = np.zeros(self._shape, dtype), np.empty(self._shape, dtype)

        def restricted(x: Array, out: Array) -> Array:
            field.reshape(-1)[self._index] = x
            # Indices that are known to be good are not looked at twice.
            return np.take(multiply(field, memory), self._index, out=out, mode="clip")

        return restricted
