"""Operators composed of others or diagonalised by a fast transform: mostly approximate inverses."""

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators.base import GridOperator, apply_to_rows, grid_of, library_for, work_of


class BlockDiagonal(GridOperator):
    """Operators on consecutive parts of a vector.

    Parameters
    ----------
    blocks : sequence of LinearOperator
        Square matrices, one for each part.
    grid_shape : tuple of int
        The shape of the whole grid, even if the blocks act on part of it.
    """

    def __init__(self, blocks: Sequence[LinearOperator], grid_shape: tuple[int, ...]) -> None:
        size = sum(block.shape[0] for block in blocks)
        # Each block acts on the grid of one component.
        work = sum(map(work_of, blocks)) / grid_shape[0]
        dtype, library = np.result_type(*(b.dtype for b in blocks)), library_for(blocks[0])
        super().__init__(dtype, grid_shape, work, size, library)
        self.blocks = tuple(blocks)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        parts, start = [], 0
        for block in self.blocks:
            x = self.library.copy(X[..., start : start + block.shape[0]])
            parts.append(apply_to_rows(block, x))
            start += block.shape[0]
        return self.library.join(parts, out)

    def _adjoint(self) -> "BlockDiagonal":
        return self._of([block.H for block in self.blocks])

    def _transpose(self) -> "BlockDiagonal":
        return self._of([block.T for block in self.blocks])

    def _of(self, blocks: Sequence[LinearOperator]) -> "BlockDiagonal":
        """Return the operator with these blocks, or itself if they are its own."""
        unchanged = all(a is b for a, b in zip(blocks, self.blocks, strict=True))
        return self if unchanged else BlockDiagonal(blocks, self.grid_shape)

    def __repr__(self) -> str:
        return f"<BlockDiagonal of {', '.join(map(repr, self.blocks))}>"


class DiagonalisedOperator(GridOperator):
    """A matrix of any number of axes, given by its eigenvalues.

    Parameters
    ----------
    product : DiagonalisedProduct
        The transform and the eigenvalues; cut to the grid if the matrix is larger.
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


class DiagonallyScaled(GridOperator):
    """The product D M D with a real diagonal matrix D; symmetric positive definite if M is.

    Parameters
    ----------
    M : LinearOperator of shape (N, N)
    scale : ndarray of shape (N,)
        The entries of D, which must not be zero.
    """

    def __init__(self, M: LinearOperator, scale: Array) -> None:
        super().__init__(M.dtype, grid_of(M), work_of(M), M.shape[0])
        self.M = M
        self.scale = scale.astype(self.dtype.char.lower())  # Real also if M is complex.

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        if out is None:
            out = np.empty(X.shape, np.result_type(X, self.dtype))
        scaled = workspace(X.shape, out.dtype)
        np.multiply(X, self.scale, out=scaled)
        return np.multiply(apply_to_rows(self.M, scaled, scaled), self.scale, out=out)

    def _adjoint(self) -> "DiagonallyScaled":
        return self._of(self.M.H)

    def _transpose(self) -> "DiagonallyScaled":
        return self._of(self.M.T)

    def _of(self, M: LinearOperator) -> "DiagonallyScaled":
        return self if M is self.M else DiagonallyScaled(M, self.scale)

    def __repr__(self) -> str:
        return f"<DiagonallyScaled {self.M!r}>"
