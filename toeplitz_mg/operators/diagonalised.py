"""Matrices that a fast transform diagonalises: circulants and their trigonometric kin."""

from math import prod
from typing import Any

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.operators.base import GridOperator


class DiagonalisedOperator(GridOperator):
    """A matrix of any number of axes, given by its eigenvalues.

    Parameters
    ----------
    product : DiagonalisedProduct
        The transform and the eigenvalues; cut to the grid where the matrix is the larger.
    name : str
        The name of the matrix, for its repr.

    Attributes
    ----------
    product : DiagonalisedProduct
    name : str
    grid_shape : tuple of int
    """

    def __init__(self, product: Any, name: str) -> None:
        work = product.points / prod(product.grid_shape)
        library = library_of(product.spectrum)
        super().__init__(product.dtype, product.grid_shape, work, library=library)
        self.name = name
        self.product = product

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self.product(X, out)

    def _adjoint(self) -> "DiagonalisedOperator":
        if self.product.is_hermitian:
            return self
        return DiagonalisedOperator(self.product.adjoint(), self.name)

    def __repr__(self) -> str:
        grid = " x ".join(map(str, self.grid_shape))
        return f"<DiagonalisedOperator {grid}, {self.name}, {self.dtype}>"
