"""Symmetric matrices that a fast transform diagonalises: circulants and their trigonometric kin."""

from math import prod
from typing import Any

from numpy.typing import NDArray

from toeplitz_mg.operators.convolution import DiagonalisedProduct
from toeplitz_mg.operators.rows import RowsOperator

Array = NDArray[Any]


class DiagonalisedOperator(RowsOperator):
    """A symmetric matrix of any number of levels, given by its eigenvalues.

    Parameters
    ----------
    product : DiagonalisedProduct
        The transform and the eigenvalues; cut to the grid where the matrix is the larger.
    name : str
        Of the matrix, for its repr.

    Attributes
    ----------
    grid_shape : tuple of int
    name : str
    """

    def __init__(self, product: DiagonalisedProduct, name: str) -> None:
        size = prod(product.grid_shape)
        super().__init__(product.dtype, (size, size))
        self.grid_shape = product.grid_shape
        self.name = name
        self._product = product

    def _apply(self, X: Array, out: Array | None = None) -> Array:
        return self._product(X, out)

    def _adjoint(self) -> "DiagonalisedOperator":
        return self

    def _transpose(self) -> "DiagonalisedOperator":
        return self

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        return f"<DiagonalisedOperator {grid}, {self.name}, {self.dtype}>"
