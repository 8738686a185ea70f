"""Type aliases for annotations."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator


class HasArray(Protocol):
    """An object that NumPy can convert to an array, such as arrays of other libraries."""

    def __array__(self) -> NDArray[Any]:
        """Return the array."""


Array = NDArray[Any]
# A number, or one for each element. NumPy's ArrayLike would also accept strings.
Numbers = float | HasArray | Sequence[float | HasArray] | Sequence[Sequence[float | HasArray]]
Series = Sequence[float] | np.ndarray[tuple[int], np.dtype[Any]]  # Exactly one axis.
Mask = NDArray[Any]  # An array of booleans.
Rows = NDArray[Any]  # Vectors on the last axis: shape (n,) or (columns, n).
Preconditioner = Callable[[LinearOperator], LinearOperator]  # Maps A to an approximation of A⁻¹.
Coarsening = Callable[[LinearOperator], LinearOperator]  # Maps A to that of the next coarser grid.
Multiply = Callable[[Array, Array], Array]  # Maps a vector and a work array to the result.
Element = float | tuple[float, float]  # The size of an element of a surface.
Unit = str | tuple[str, str]  # One for heights and elements, or one for each.
Progress = Callable[[int, float], object]  # Called with the number of products and the residual.
