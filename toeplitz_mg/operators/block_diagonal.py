"""Operators on consecutive parts of a vector, as on the components of a field."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.base import GridOperator, apply_to_rows, library_for, work_of


class BlockDiagonal(GridOperator):
    """Operators on consecutive parts of a vector.

    Parameters
    ----------
    blocks : sequence of LinearOperator
        Square matrices, one for each part.
    grid_shape : tuple of int
        The shape of the whole grid, also where the blocks are those of a part of it.
    """

    def __init__(self, blocks: Sequence[LinearOperator], grid_shape: tuple[int, ...]) -> None:
        size = sum(block.shape[0] for block in blocks)
        # Each block works on the grid of one component.
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
        """Return the operator of these blocks, itself where they are its own."""
        unchanged = all(a is b for a, b in zip(blocks, self.blocks, strict=True))
        return self if unchanged else BlockDiagonal(blocks, self.grid_shape)

    def __repr__(self) -> str:
        return f"<BlockDiagonal of {', '.join(map(repr, self.blocks))}>"
