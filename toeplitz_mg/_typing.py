"""The types that annotations name."""

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

Array = NDArray[Any]
Mask = NDArray[Any]  # of booleans
Rows = NDArray[Any]  # vectors on the last axis: shape (n,) or (columns, n)
Preconditioner = Callable[[LinearOperator], LinearOperator]  # A to an approximation of its inverse
Multiply = Callable[[Array, Array], Array]  # a vector, and memory for the result, to the result
Element = float | tuple[float, float]  # the size of an element of a surface
Progress = Callable[[int, float], object]  # called with the products made and the residual
