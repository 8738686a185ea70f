"""Symmetric matrices that a fast transform diagonalises: circulants and their trigonometric kin."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators.convolution import Convolution
from toeplitz_mg.operators.rows import as_rows

Array = NDArray[Any]


class DiagonalisedOperator(LinearOperator):
    """A symmetric matrix of any number of levels, given by its eigenvalues.

    Parameters
    ----------
    convolution : Convolution
        The transform and the eigenvalues; cut to the grid where the matrix is the larger.
    name : str
        Of the matrix, for its repr.

    Attributes
    ----------
    grid_shape : tuple of int
    name : str
    """

    def __init__(self, convolution: Convolution, name: str) -> None:
        size = prod(convolution.grid_shape)
        super().__init__(convolution.dtype, (size, size))
        self.grid_shape = convolution.grid_shape
        self.name = name
        self._convolution = convolution

    def _apply(self, X: Array, out: Array | None = None) -> Array:
        return self._convolution(X, out)

    def _matvec(self, x: Array) -> Array:
        return self._apply(as_rows(x, self.shape[1]))

    def _matmat(self, X: Array) -> Array:
        return np.asarray(self._apply(X.mT).mT)

    def _adjoint(self) -> "DiagonalisedOperator":
        return self

    def _transpose(self) -> "DiagonalisedOperator":
        return self

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        return f"<DiagonalisedOperator {grid}, {self.name}, {self.dtype}>"
