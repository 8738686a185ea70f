"""What a multilevel sparse approximate inverse takes from the kernel alone, for every mask."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toeplitz_mg.preconditioners.positivity import robust

Array = NDArray[Any]
Pair = tuple[int, int]

NEIGHBOURS = 12  # cells before a cell that its row of G sees: half of a 5 x 5 neighbourhood
AGGREGATE = 16  # cells of a block: 4 x 4 where they are square
EXACT = 3  # blocks: from this lag on the loads of two blocks are taken as uniform
CHUNK = 1024  # cells or blocks that are treated together, in the cache


@dataclass(frozen=True)
class Stencil:
    """One level for a kernel: the neighbours of a cell, the aggregates, the coarser kernel.

    Everything is computed where it is first asked for. The grid of cells is kept flattened, with
    a margin and whole blocks, so that each cell has its neighbours and each block its cells.

    Attributes
    ----------
    T : ndarray of shape (n1, n2)
        Coefficients, even in both axes; one level is 1 x n.
    """

    T: Array

    @cached_property
    def offsets(self) -> Array:
        """The cell itself and those before it where the kernel is largest, shape (K, 2)."""
        n1, n2 = (min(n, NEIGHBOURS + 1) for n in self.T.shape)
        before = [(-i, -j) for i in range(n1) for j in range(1 - n2, n2) if (i, j) > (0, 0)]
        before.sort(key=lambda k: (-abs(self.T[abs(k[0]), abs(k[1])]), abs(k[0]) + abs(k[1])))
        return np.array([(0, 0), *before[:NEIGHBOURS]])

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
        padded = np.full(self.padded, margin, grid.dtype)
        padded[self._inner] = grid
        return padded.ravel()

    def without_margin(self, padded: Array) -> Array:
        """Return the grid, the converse of `place`."""
        return padded.reshape(self.padded)[self._inner]

    @property
    def _inner(self) -> tuple[slice, slice]:
        (n1, n2), (p1, p2) = self.T.shape, self.reach
        return slice(p1, p1 + n1), slice(p2, p2 + n2)

    @cached_property
    def steps(self) -> Array:
        """From a cell to its neighbours, shape (K,)."""
        return self._flat(self.offsets)

    @cached_property
    def origins(self) -> Array:
        """The first cell of every block."""
        return self._flat(np.indices(self.blocks).reshape(2, -1).T * self.block + self.reach)

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

    def coupling(self, k1: int, k2: int) -> Array:
        """A between the windows of two blocks."""
        cells = self.window_cells
        return self.at(np.array([k1, k2]) * self.block + cells[:, None] - cells)

    @cached_property
    def own(self) -> Array:
        """A among the cells of one window."""
        return self.coupling(0, 0)

    def rows_in_contact(self, patterns: Array) -> Array:
        """Return columns of rows of G, where bit k - 1 says if neighbour k is in contact.

        Parameters
        ----------
        patterns : ndarray of int, shape (m,)

        Returns
        -------
        ndarray of shape (K, m)
        """
        bits = patterns[:, None] >> np.arange(len(self.offsets) - 1) & 1
        contact = np.c_[np.ones(len(bits), int), bits]
        return np.asarray(rows_of_G(self, contact, np.where(contact, self.T[0, 0], 1.0)).T)

    @cached_property
    def full_load(self) -> Array:
        """The load Gᵀ w of an aggregate in full contact, on its window."""
        row = self.rows_in_contact(np.array([2 ** (len(self.offsets) - 1) - 1]))
        w = np.full((1, AGGREGATE), AGGREGATE**-0.5)
        return block_loads(self, row, np.zeros((1, AGGREGATE), int), w).ravel()

    @cached_property
    def coarser(self) -> "Stencil":
        """The same for E, whose coefficients are those of aggregates in full contact."""
        load = self.full_load
        total = float(load.sum())
        if not total > 0.0:
            raise refused("the load of an aggregate is", total, self)
        T = self.T
        for axis, (m, h) in enumerate(zip(self.blocks, self.block, strict=True)):
            T = _averaged(T, axis, m, h)
        T = total**2 * T
        for k in product(*(range(min(m, EXACT)) for m in self.blocks)):
            T[k] = np.mean([load @ self.coupling(k[0], j) @ load for j in (k[1], -k[1])])
        return Stencil(T)


def rows_of_G(stencil: Stencil, c: Array, d: Array) -> Array:
    """Return rows of G for the matrix c_i T(i-j) c_j with the diagonal d.

    Parameters
    ----------
    stencil : Stencil
    c, d : ndarray of shape (m, K)
        Of a cell and its neighbours; 0 and 1 where they are not in contact.

    Returns
    -------
    ndarray of shape (m, K)
        S⁻¹ e / √(eᵀ S⁻¹ e), S the matrix of these cells and e the first; zero where there is no
        contact.
    """
    m, K = c.shape
    rows = np.empty((m, K))
    for part in chunks(m):
        # All systems together, entry by entry: half the time of LAPACK, one by one.
        weights = np.ascontiguousarray(c[part].T)
        S = stencil.local[:, :, None] * weights[:, None]
        S *= weights
        S[range(K), range(K)] += d[part].T - stencil.T[0, 0] * weights**2
        for k in range(K - 1, -1, -1):  # e, the first, is eliminated last
            pivot = S[k, k]
            if not (pivot > 0.0).all():
                raise refused("a pivot is", float(pivot.min()), stencil)
            factors = S[k, :k] / pivot
            S[:k, :k] -= factors[:, None] * S[k, :k]
            S[k, :k] = factors
        row = np.empty(weights.shape)
        row[0] = 1.0 / np.sqrt(S[0, 0])
        for k in range(1, K):
            row[k] = -np.einsum("jm,jm->m", S[k, :k], row[:k])
        rows[part] = row.T
    return rows


def block_loads(stencil: Stencil, rows: Array, index: Array, w: Array) -> Array:
    """Return Gᵀ w on the windows of blocks, shape (m, window).

    Parameters
    ----------
    stencil : Stencil
    rows : ndarray of shape (K, any)
        Columns of rows of G.
    index : ndarray of int, shape (m, h1 h2)
        For each cell of the blocks the place of its row.
    w : ndarray of shape (m, h1 h2)
        Zero in cells that are not in contact.
    """
    (h1, h2), (p1, p2) = stencil.block, stencil.reach
    loads = np.zeros((len(w), *stencil.window_shape))
    for g, (a, b) in zip(rows, stencil.offsets, strict=True):
        part = loads[:, p1 + a : p1 + a + h1, p2 + b : p2 + b + h2]
        part += (g.take(index) * w).reshape(-1, h1, h2)
    return loads.reshape(len(w), -1)


def _averaged(T: Array, axis: int, m: int, h: int) -> Array:
    """Return the means of T over pairs of blocks of h cells in one axis, for m lags of blocks."""
    k = np.arange(1 - h, m * h)
    T = np.moveaxis(np.take(T, np.minimum(np.abs(k), T.shape[axis] - 1), axis), axis, 0)
    pairs = h - np.abs(k[: 2 * h - 1])  # of cells, one in either block, with each lag
    means = sum(p / h**2 * T[j : j + (m - 1) * h + 1 : h] for j, p in enumerate(pairs))
    return np.moveaxis(np.asarray(means), 0, axis)


def chunks(m: int) -> Iterator[slice]:
    """Cut range(m) into slices, the work of which stays in the cache."""
    return (slice(k, min(k + CHUNK, m)) for k in range(0, m, CHUNK))


def refused(subject: str, value: float, stencil: Stencil) -> np.linalg.LinAlgError:
    """Return the error of a kernel for which the construction fails."""
    levels = max(sum(n > 1 for n in stencil.T.shape), 1)
    return np.linalg.LinAlgError(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        f"positive definite, or too smooth a kernel for it; use {robust(levels)}"
    )
