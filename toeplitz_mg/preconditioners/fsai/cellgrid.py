"""The cells of a level of a multilevel sparse approximate inverse: neighbours and aggregates."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array

PerAxis = tuple[int, int]  # A number for each of the two axes.

AGGREGATE = 16  # Cells of an aggregate, 4 x 4 if they are square; a row of G uses about as many.


@dataclass(frozen=True)
class CellGrid:
    """A grid of cells, with the neighbours of a cell and the blocks that are aggregates.

    Everything is computed on demand. The cells are stored flattened, with a margin and whole
    blocks, so that each cell has all neighbours and each block all cells.

    Attributes
    ----------
    kernel : ndarray of shape (n1, n2)
        Coefficients, even in both axes, which decide which cells are near; a line is 1 x n.
    neighbours : int
        The number of preceding cells that a row of G uses.
    part : (m1, m2), optional
        The shape of the local cells, if they are only some rows of the whole grid.
    """

    kernel: Array
    neighbours: int
    part: PerAxis | None = None

    @property
    def shape(self) -> PerAxis:
        """The shape of the local cells."""
        n1, n2 = self.kernel.shape
        return self.part or (n1, n2)

    @cached_property
    def offsets(self) -> Array:
        """The cell itself and the preceding cells with the largest kernel, shape (K, 2)."""
        near = np.abs(self.kernel[: self.neighbours + 1, : self.neighbours + 1])
        n1, n2 = near.shape
        # The cells that precede the cell itself.
        i, j = np.mgrid[:n1, 1 - n2 : n2].reshape(2, -1)[:, n2:]
        nearest = np.lexsort((i + np.abs(j), -near[i, np.abs(j)]))[: self.neighbours]
        before = np.stack([-i, -j], axis=-1)[nearest]
        return np.concatenate([np.zeros((1, 2), before.dtype), before])

    @cached_property
    def reach(self) -> PerAxis:
        """The distance of the farthest neighbour along each axis."""
        first, second = np.abs(self.offsets).max(axis=0)
        return int(first), int(second)

    @cached_property
    def block(self) -> PerAxis:
        """The shape of an aggregate; the kernel decays equally along both sides."""
        n1, n2 = self.kernel.shape
        sides = [2**p for p in range(AGGREGATE.bit_length())]
        shapes = [(h, AGGREGATE // h) for h in sides if h < 2 * n1 and AGGREGATE // h < 2 * n2]
        K = self.kernel
        # Shapes that reach beyond a small grid may look equal: prefer the one whose cells, as far
        # as they exist, are coupled most. A grid that is smaller than all shapes is one block.
        return min(
            shapes or [(4, 4)],
            key=lambda h: (
                abs(K[min(h[0], n1 - 1), 0] - K[0, min(h[1], n2 - 1)]),
                -K[: h[0], : h[1]].sum(),
            ),
        )

    @cached_property
    def blocks(self) -> PerAxis:
        """The number of aggregates along each axis: the grid of the next level."""
        (n1, n2), (h1, h2) = self.shape, self.block
        return -(-n1 // h1), -(-n2 // h2)

    @cached_property
    def padded(self) -> PerAxis:
        """The shape of the grid with its margin."""
        (m1, m2), (h1, h2), (p1, p2) = self.blocks, self.block, self.reach
        return p1 + m1 * h1, m2 * h2 + 2 * p2

    def place(self, grid: Array, margin: float) -> Array:
        """Return a flattened copy of the grid with a margin of this value.

        The grid may include rows above the local ones; they go into the margin.
        """
        (n1, n2), (p1, p2) = self.shape, self.reach
        padded: Array = np.full(self.padded, margin, grid.dtype)
        padded[p1 + n1 - len(grid) : p1 + n1, p2 : p2 + n2] = grid
        return padded.ravel()

    @cached_property
    def size(self) -> int:
        """The number of cells including the margin."""
        return self.padded[0] * self.padded[1]

    @cached_property
    def block_of(self) -> Array:
        """The block of every cell; in the margin that of a nearby block."""
        i, j = (
            ((np.arange(n, dtype=np.int32) - p) // h).clip(0, m - 1)
            for n, p, h, m in zip(self.padded, self.reach, self.block, self.blocks, strict=True)
        )
        return np.add.outer(i * self.blocks[1], j).ravel()

    @cached_property
    def inside(self) -> Array:
        """The places of the cells of the grid."""
        return self._every(self.shape, (1, 1)).astype(np.int32)

    @cached_property
    def steps(self) -> Array:
        """The steps from a cell to itself and its neighbours, shape (K,)."""
        return self._flat(self.offsets)

    @cached_property
    def origins(self) -> Array:
        """The first cell of every block."""
        return self._every(self.blocks, self.block)

    @cached_property
    def slots(self) -> Array:
        """The steps from the first cell of a block to all of its cells, shape (h1 h2,)."""
        return self._flat(np.indices(self.block).reshape(2, -1).T)

    @cached_property
    def window_shape(self) -> PerAxis:
        """The shape of a window: a block and the neighbours of its cells."""
        return self.block[0] + self.reach[0], self.block[1] + 2 * self.reach[1]

    @cached_property
    def window_cells(self) -> Array:
        """The offsets of the cells of a window from the first cell of its block, (window, 2)."""
        return np.indices(self.window_shape).reshape(2, -1).T - self.reach

    @cached_property
    def window(self) -> Array:
        """The steps from the first cell of a block to the cells of its window, shape (window,)."""
        return self._flat(self.window_cells)

    def _every(self, shape: PerAxis, step: PerAxis) -> Array:
        """Return the places of cells these steps apart, starting at the first cell of the grid."""
        i, j = (p + h * np.arange(m) for p, h, m in zip(self.reach, step, shape, strict=True))
        return np.add.outer(i * self.padded[1], j).ravel()

    def _flat(self, cells: Array) -> Array:
        return cells @ np.array([self.padded[1], 1])
