"""What a multilevel sparse approximate inverse takes from the kernel alone, for every mask."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from toeplitz_mg.preconditioners.positivity import for_smooth_kernels

Array = NDArray[Any]
Pair = tuple[int, int]

NEIGHBOURS = 12  # cells before a cell that its row of G sees: half of a 5 x 5 neighbourhood
AGGREGATE = 16  # cells of a block: 4 x 4 where they are square
EXACT = 3  # blocks: from this lag on the loads of two blocks are taken as uniform


class Near(Protocol):
    """What the rows of G take from a kernel."""

    @property
    def T(self) -> Array:
        """Coefficients."""

    @property
    def local(self) -> Array:
        """A less τ, among a cell and its neighbours, shape (K, K)."""


@dataclass(frozen=True)
class Stencil:
    """One level for a kernel: the neighbours of a cell, the aggregates, the coarser kernel.

    Everything is computed where it is first asked for. The grid of cells is kept flattened, with
    a margin and whole blocks, so that each cell has its neighbours and each block its cells.

    Attributes
    ----------
    T : ndarray of shape (n1, n2)
        Coefficients, even in both axes; one level is 1 x n.
    neighbours : int
        Cells before a cell that its row of G sees.
    """

    T: Array
    neighbours: int = field(default_factory=lambda: NEIGHBOURS)

    @cached_property
    def offsets(self) -> Array:
        """The cell itself and those before it where the kernel is largest, shape (K, 2)."""
        near = np.abs(self.T[: self.neighbours + 1, : self.neighbours + 1]).tolist()
        n1, n2 = len(near), len(near[0])
        before = [(-i, -j) for i in range(n1) for j in range(1 - n2, n2) if (i, j) > (0, 0)]
        before.sort(key=lambda k: (-near[-k[0]][abs(k[1])], abs(k[0]) + abs(k[1])))
        return np.array([(0, 0), *before[: self.neighbours]])

    @cached_property
    def reach(self) -> Pair:
        """The farthest neighbour in either axis."""
        first, second = np.abs(self.offsets).max(axis=0)
        return int(first), int(second)

    @cached_property
    def block(self) -> Pair:
        """Shape of an aggregate: the kernel decays alike over its two sides."""
        n1, n2 = self.T.shape
        sides = [2**p for p in range(AGGREGATE.bit_length())]
        shapes = [(h, AGGREGATE // h) for h in sides if h < 2 * n1 and AGGREGATE // h < 2 * n2]
        return min(  # of a grid that is smaller than any, one block is all
            shapes or [(4, 4)],
            key=lambda h: abs(self.T[min(h[0], n1 - 1), 0] - self.T[0, min(h[1], n2 - 1)]),
        )

    @cached_property
    def blocks(self) -> Pair:
        """The number of aggregates in either axis: the grid of the next level."""
        (n1, n2), (h1, h2) = self.T.shape, self.block
        return -(-n1 // h1), -(-n2 // h2)

    @cached_property
    def padded(self) -> Pair:
        """Shape of the grid with its margin."""
        (m1, m2), (h1, h2), (p1, p2) = self.blocks, self.block, self.reach
        return p1 + m1 * h1, m2 * h2 + 2 * p2

    def place(self, grid: Array, margin: float) -> Array:
        """Return the grid with a margin of this value, flattened."""
        padded: Array = np.full(self.padded, margin, grid.dtype)
        self.without_margin(padded)[...] = grid.reshape(self.T.shape)
        return padded.ravel()

    @cached_property
    def block_of(self) -> Array:
        """The block of every cell; in the margin any near."""
        i, j = (
            ((np.arange(n, dtype=np.int32) - p) // h).clip(0, m - 1)
            for n, p, h, m in zip(self.padded, self.reach, self.block, self.blocks, strict=True)
        )
        return np.asarray(np.add.outer(i * self.blocks[1], j).ravel())

    def aggregate_of(self, at: Array) -> Array:
        """Return the places of the aggregates of these cells, on the grid of the next level."""
        return self.coarser.inside.take(self.block_of.take(at))

    def without_margin(self, padded: Array) -> Array:
        """Return the grid, the converse of `place`; a view."""
        (n1, n2), (p1, p2) = self.T.shape, self.reach
        return np.asarray(padded.reshape(self.padded)[p1 : p1 + n1, p2 : p2 + n2])

    @cached_property
    def inside(self) -> Array:
        """The places of the cells of the grid."""
        return self._every(self.T.shape, (1, 1)).astype(np.int32)

    @cached_property
    def steps(self) -> Array:
        """From a cell to its neighbours, shape (K,)."""
        return self._flat(self.offsets)

    @cached_property
    def origins(self) -> Array:
        """The first cell of every block."""
        return self._every(self.blocks, self.block)

    @cached_property
    def band(self) -> int:
        """From the first cell of a row of blocks to that of the next; in one level, of a block."""
        return self.block[1] if self.T.shape[0] == 1 else self.block[0] * self.padded[1]

    @cached_property
    def slots(self) -> Array:
        """From the first cell of a block to all of them, shape (h1 h2,)."""
        return self._flat(np.indices(self.block).reshape(2, -1).T)

    @cached_property
    def window_shape(self) -> Pair:
        """A block and the neighbours of its cells."""
        return self.block[0] + self.reach[0], self.block[1] + 2 * self.reach[1]

    @cached_property
    def window_cells(self) -> Array:
        """From the first cell of a block to those of its window, shape (window, 2)."""
        return np.indices(self.window_shape).reshape(2, -1).T - self.reach

    @cached_property
    def window(self) -> Array:
        """The same, shape (window,)."""
        return self._flat(self.window_cells)

    def _every(self, shape: Pair, step: Pair) -> Array:
        """The places of cells these steps apart, from the first of the grid on."""
        i, j = (p + h * np.arange(m) for p, h, m in zip(self.reach, step, shape, strict=True))
        return np.asarray(np.add.outer(i * self.padded[1], j).ravel())

    def _flat(self, cells: Array) -> Array:
        return np.asarray(cells @ np.array([self.padded[1], 1]))

    def at(self, k: Array) -> Array:
        """Return T at lags of shape (..., 2); beyond the grid that of its last lag."""
        n1, n2 = self.T.shape
        k = np.abs(k)
        return np.asarray(self.T[np.minimum(k[..., 0], n1 - 1), np.minimum(k[..., 1], n2 - 1)])

    @cached_property
    def far(self) -> float:
        """The coefficient τ twice as far as the neighbours are, which they see as a constant."""
        beyond = [min(2 * p + 2, n - 1) for p, n in zip(self.reach, self.T.shape, strict=True)]
        ends = [(self.T[beyond[0], 0], beyond[0]), (self.T[0, beyond[1]], beyond[1])]
        return min((float(value) for value, lag in ends if lag > 0), default=0.0)

    @cached_property
    def local(self) -> Array:
        """A less τ, among a cell and its neighbours, shape (K, K)."""
        return self.at(self.offsets[:, None] - self.offsets) - self.far

    @cached_property
    def own(self) -> Array:
        """A among the cells of one window."""
        return self.at(self.window_cells[:, None] - self.window_cells)

    @cached_property
    def table(self) -> Array:
        """Rows of G for A itself by pattern, whose bit k - 1 says if neighbour k is in contact.

        Columns of shape (K,), zero where there is no contact. The farthest neighbours are
        eliminated first, from all patterns that have the same ones among them together.
        """
        S = self.local[:, :, None]
        eliminated = []
        for k in range(len(S) - 1, 0, -1):
            check("a pivot is", S[k, k].min(), self)
            factors = S[k, :k] / S[k, k]
            without, S = S[:k, :k], S[:k, :k] - factors[:, None] * S[k, :k]
            S = np.stack([without, S], axis=-1).reshape(k, k, -1)
            eliminated.append(np.stack([np.zeros(factors.shape), factors], axis=-1))
        check("a pivot is", S.min(), self)
        rows = np.empty((len(self.local), S.size))
        rows[0] = 1.0 / np.sqrt(S[0, 0])
        for k, factors in enumerate(reversed(eliminated), 1):
            factors = factors.reshape(k, -1)
            known = rows[:k].reshape(k, factors.shape[1], -1)
            rows[k] = -np.einsum("js,jsr->sr", factors, known).ravel()
        return rows

    @cached_property
    def table_sums(self) -> Array:
        """Products of the rows in the table with the vector of ones."""
        return np.asarray(self.table.sum(axis=0))

    @cached_property
    def sparse_table(self) -> csr_array:
        """The same as of `sparse`."""
        return self.sparse(np.ascontiguousarray(self.table.T))

    def sparse(self, rows: Array) -> csr_array:
        """Return a matrix of rows of G, without their zeros; its columns are `steps`, from 0 on."""
        known = rows != 0.0
        K = rows.shape[1]
        starts = np.append(np.int32(0), np.cumsum(known, dtype=np.int32)[K - 1 :: K])
        steps = (self.steps - self.steps.min()).astype(np.int32)
        where = np.flatnonzero(known)
        entries, columns = rows.take(where), np.tile(steps, len(rows)).take(where)
        return csr_array((entries, columns, starts), (len(rows), int(steps.max()) + 1))

    @cached_property
    def full_load(self) -> Array:
        """The load Gᵀ w of an aggregate in full contact, on its window."""
        check("an eigenvalue of a neighbourhood is", np.linalg.eigvalsh(self.local)[0], self)
        row = np.linalg.inv(self.local)[:, :1]
        row /= np.sqrt(row[0])
        w = np.full((AGGREGATE, 1), AGGREGATE**-0.5)
        return block_loads(self, row, np.zeros((AGGREGATE, 1), int), w).ravel()

    @cached_property
    def coarser(self) -> "Stencil":
        """The same for E, whose coefficients are those of aggregates in full contact."""
        load = self.full_load
        total = float(load.sum())
        check("the load of an aggregate is", total, self)
        T = self.T
        for axis, (m, h) in enumerate(zip(self.blocks, self.block, strict=True)):
            T = averaged(T, axis, m, h)
        T = total**2 * T
        # The load's products by the lag between their cells.
        first, second = np.array(self.window_shape) - 1
        lags = np.indices((2 * first + 1, 2 * second + 1)).reshape(2, -1).T - (first, second)
        cell = self.window_cells @ (2 * second + 1, 1)
        between = cell[:, None] - cell + len(lags) // 2
        products = np.bincount(between.ravel(), np.outer(load, load).ravel(), len(lags))
        for k in product(*(range(min(m, EXACT)) for m in self.blocks)):
            shifts = np.array(self.block) * (k, (k[0], -k[1]))
            T[k] = np.mean(self.at(shifts[:, None] + lags) @ products)
        return Stencil(T)


def block_loads(stencil: Stencil, rows: Array, index: Array, w: Array) -> Array:
    """Return Gᵀ w on the windows of blocks, shape (window, m).

    Parameters
    ----------
    stencil : Stencil
    rows : ndarray of shape (K, any)
        Columns of rows of G.
    index : ndarray of int, shape (h1 h2, m)
        For each cell of the blocks the place of its row.
    w : ndarray of shape (h1 h2, m)
        Zero in cells that are not in contact.
    """
    (h1, h2), (p1, p2) = stencil.block, stencil.reach
    loads = np.zeros((*stencil.window_shape, w.shape[1]))
    index = index.astype(np.intp, copy=False)
    for g, (a, b) in zip(rows, stencil.offsets, strict=True):
        part = loads[p1 + a : p1 + a + h1, p2 + b : p2 + b + h2]
        part += (g.take(index) * w).reshape(part.shape)
    return loads.reshape(len(stencil.window), w.shape[1])


def averaged(T: Array, axis: int, m: int, h: int) -> Array:
    """Return the means of T over pairs of blocks of h cells in one axis, for m lags of blocks."""
    lags = h * np.arange(m)
    means: Any = 0.0
    for k in range(1 - h, h):
        pairs = h - abs(k)  # of cells, one in either block, with each lag
        means += T.take(np.minimum(np.abs(lags + k), T.shape[axis] - 1), axis) * (pairs / h**2)
    return np.asarray(means)


def check(subject: str, value: float, stencil: Near) -> None:
    """Refuse a kernel for which a number that must be positive is not."""
    if not value > 0.0:
        raise refused(subject, value, stencil)


def refused(subject: str, value: float, stencil: Near) -> np.linalg.LinAlgError:
    """Return the error of a kernel for which the construction fails."""
    return np.linalg.LinAlgError(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        f"positive definite, or too smooth a kernel for it; {for_smooth_kernels(stencil.T.shape)}"
    )
