"""The types that annotations name."""

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

Array = NDArray[Any]
Mask = NDArray[Any]  # of booleans
Rows = NDArray[Any]  # vectors on the last axis: shape (n,) or (columns, n)
Preconditioner = Callable[[LinearOperator], LinearOperator]  # A to an approximation of its inverse
