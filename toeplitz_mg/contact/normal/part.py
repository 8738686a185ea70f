"""Fields restricted to some elements, if they are zero on most of the grid."""

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Mask, Multiply


class Whole:
    """All elements, in place of a `Part`, if restricting vectors does not pay off."""

    def cut(self, x: Array) -> Array:
        """Return the field itself."""
        return x

    def put(self, part: Array, x: Array) -> Array:
        """Return the other field."""
        return part

    def restrict(self, multiply: Multiply, dtype: DTypeLike) -> Multiply:
        """Return the same function."""
        return multiply


class Part:
    """Some elements of a grid, whose fields are vectors with one axis.

    Products are with the whole grid. Everything else, such as inner products, uses these elements
    only, and so skips the zeros elsewhere.
    """

    def __init__(self, elements: Mask) -> None:
        self._shape, self._index = elements.shape, np.flatnonzero(elements)

    def cut(self, x: Array) -> Array:
        """Return the field on these elements."""
        return np.take(x, self._index)

    def put(self, part: Array, x: Array) -> Array:
        """Return `x` with its values on these elements replaced by `part`."""
        whole: Array = x.copy()
        whole.reshape(-1)[self._index] = part
        return whole

    def restrict(self, multiply: Multiply, dtype: DTypeLike) -> Multiply:
        """Return a function for fields on these elements, given one for fields on the grid."""
        field, memory = np.zeros(self._shape, dtype), np.empty(self._shape, dtype)

        def restricted(x: Array, out: Array) -> Array:
            field.reshape(-1)[self._index] = x
            # These indices are valid, so they need not be checked again.
            return np.take(multiply(field, memory), self._index, out=out, mode="clip")

        return restricted
