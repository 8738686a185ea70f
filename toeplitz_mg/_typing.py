"""The types that annotations name."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator


class HasArray(Protocol):
    """What NumPy makes an array of, as those of other libraries."""

    def __array__(self) -> NDArray[Any]:
        """Return the array."""


Array = NDArray[Any]
# A number, or one for each element. NumPy's ArrayLike also takes strings.
Numbers = float | HasArray | Sequence[float | HasArray] | Sequence[Sequence[float | HasArray]]
Series = Sequence[float] | np.ndarray[tuple[int], np.dtype[Any]]  # On one axis, for certain.
Mask = NDArray[Any]  # An array of booleans.
Rows = NDArray[Any]  # Vectors on the last axis: shape (n,) or (columns, n).
Preconditioner = Callable[[LinearOperator], LinearOperator]  # From A to an approximation of A⁻¹.
Coarsening = Callable[[LinearOperator], LinearOperator]  # From A to that of the next coarser grid.
Multiply = Callable[[Array, Array], Array]  # From a vector, and memory to use, to the result.
Element = float | tuple[float, float]  # The size of an element of a surface.
Unit = str | tuple[str, str]  # Of heights and elements alike, or of each.
Progress = Callable[[int, float], object]  # Called with the products made and the residual.
