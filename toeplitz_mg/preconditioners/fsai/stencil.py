"""The part of a level of a multilevel sparse approximate inverse that depends only on the kernel.

It is the same for every mask. The kernel has one component, or two coupled ones (see `coupled`). An
unknown is identified by its place: the place of its cell in the padded grid of its component, where
the places of the second component follow all those of the first.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.cellgrid import AGGREGATE, CellGrid, PerAxis
from toeplitz_mg.preconditioners.fsai.rows import (
    Neighbourhood,
    add_loads,
    require_positive,
    tabulate_rows,
)

NEIGHBOURS = 12  # Preceding cells that a row of G uses: half of a 5 x 5 neighbourhood.
MOST_TABULATED = 14  # Most neighbours for a table of rows: the patterns then fit into an int16.
EXACT = 3  # Lag in blocks from which the loads of two blocks are taken as uniform.
OTHERS = 2  # Neighbours in the other component; the 2 · 2^14 patterns fit an int16.


@dataclass(frozen=True)
class Stencil:
    """The rows of G, the loads of aggregates and the coarser kernel of one level.

    Everything is computed on demand.

    Attributes
    ----------
    kernel : ndarray of shape (d, d, n1, n2)
        Coefficients of d = 1 or 2 components: even in both axes within a component, odd in both
        between the two. A line is a grid of 1 x n.
    neighbours : int
        The number of preceding cells that a row of G uses.
    coarse_neighbours : int
        The same on all coarser levels.
    part : (m1, m2), optional
        The shape of the local cells, if they are some rows of the whole grid. The kernel may then
        lack lags that they do not use (but `coarser` and `matrix` need all).
    """

    kernel: Array
    neighbours: int = NEIGHBOURS
    coarse_neighbours: int = NEIGHBOURS
    part: PerAxis | None = None

    @classmethod
    def of_one(cls, kernel: Array, neighbours: int = NEIGHBOURS) -> "Stencil":
        """Return the stencil of one component with a kernel of shape (n1, n2)."""
        return cls(kernel[None, None], neighbours)

    @cached_property
    def grid(self) -> CellGrid:
        """The cells of a component; the mean kernel determines neighbours and aggregates."""
        own = [self.kernel[a, a] for a in self.components]
        return CellGrid(own[0] if len(own) == 1 else sum(own) / 2.0, self.neighbours, self.part)

    @cached_property
    def components(self) -> range:
        """The numbers of the components."""
        return range(len(self.kernel))

    @cached_property
    def zero(self) -> Array:
        """The diagonal of A in each component."""
        return self.kernel[self.components, self.components, 0, 0]

    def on_places(self, values: Array) -> Array:
        """Return the value of its component at every place; a view for one component."""
        size = self.grid.size
        return np.broadcast_to(values[:, None], (len(values), size)).reshape(-1)

    def split(self, at: Array) -> list[Array]:
        """Split ascending places into those of each component."""
        ends = [*at.searchsorted([a * self.grid.size for a in self.components[1:]]), len(at)]
        return [at[start:end] for start, end in pairwise([0, *ends])]

    @cached_property
    def others(self) -> Array:
        """The numbers of the neighbours that a row also uses in the other component."""
        if len(self.kernel) == 1:
            return np.zeros(0, int)
        return np.argsort(-np.abs(self.at(0, 1, self.grid.offsets)), kind="stable")[:OTHERS]

    @cached_property
    def steps(self) -> Array:
        """The steps from an unknown of each component to those that its row of G uses, (d, K)."""
        own, other = self.grid.steps, self.grid.steps[self.others]
        steps = [[*own, *(other + sign * self.grid.size)] for sign in (1, -1)]
        return np.array(steps[: len(self.kernel)])

    def at(self, a: Any, b: Any, k: Array) -> Array:
        """Return coefficients between components at lags of shape (..., 2).

        Beyond the grid they equal that of its last lag.
        """
        n1, n2 = self.kernel.shape[2:]
        i, j = k[..., 0], k[..., 1]
        value = self.kernel[a, b, np.minimum(np.abs(i), n1 - 1), np.minimum(np.abs(j), n2 - 1)]
        if len(self.kernel) == 1:
            return value
        return np.where(np.equal(a, b), value, np.sign(i) * np.sign(j) * value)

    def matrix(self, places: Array) -> Array:
        """Return A between the unknowns at these places."""
        component, cell = np.divmod(places, self.grid.size)
        i, j = np.divmod(cell, self.grid.padded[1])
        d, n1, n2 = self.kernel.shape[1:]
        lag = np.abs(i[:, None] - i) * n2 + np.abs(j[:, None] - j)
        if d == 1:
            return self.kernel.take(lag)
        A = self.kernel.take(lag + (d * component[:, None] + component) * (n1 * n2))
        between = component[:, None] != component
        A[between] *= (np.sign(i[:, None] - i) * np.sign(j[:, None] - j))[between]
        return A

    @cached_property
    def far(self) -> float:
        """τ, the coefficient at twice the distance of the neighbours, their common constant."""
        kernel, reach = self.grid.kernel, self.grid.reach
        i, j = (min(2 * p + 2, n - 1) for p, n in zip(reach, kernel.shape, strict=True))
        ends = [(kernel[i, 0], i), (kernel[0, j], j)]
        return min((float(value) for value, lag in ends if lag > 0), default=0.0)

    @cached_property
    def near(self) -> tuple[Neighbourhood, ...]:
        """The neighbourhood of a row of G in each component."""
        offsets, result = self.grid.offsets, []
        cells = np.concatenate([offsets, offsets[self.others]])
        for a in self.components:
            b = np.repeat([a, 1 - a], [len(offsets), len(self.others)])
            S = self.at(b[:, None], b, cells[:, None] - cells)
            S -= self.far * np.equal.outer(b, b)
            result.append(Neighbourhood(S, self.zero[b]))
        return tuple(result)

    @cached_property
    def own(self) -> tuple[Array, ...]:
        """A between the cells of one window, for each component."""
        cells = self.grid.window_cells
        return tuple(self.at(a, a, cells[:, None] - cells) for a in self.components)

    @cached_property
    def patterns(self) -> int:
        """The number of patterns of active neighbours; in the last one all are active."""
        return int(2 ** (self.steps.shape[1] - 1))

    @cached_property
    def table(self) -> Array:
        """Rows of G for A by component and pattern; bit k - 1 tells whether neighbour k is active.

        They are columns of shape (K,), zero for inactive neighbours.
        """
        return np.hstack([tabulate_rows(near) for near in self.near])

    @cached_property
    def table_sums(self) -> Array:
        """The products of the rows in the table with ones, in their own component and the other."""
        return self.sums(self.table, np.ones((len(self.table), 1)))

    def sums(self, rows: Array, c: Array) -> Array:
        """Return products of columns with c in their own component and the other, (d, any)."""
        K = len(self.grid.steps)
        parts = (slice(0, K), slice(K, None))[: len(self.kernel)]
        return np.stack([np.einsum("km,km->m", *np.broadcast_arrays(rows[k], c[k])) for k in parts])

    @cached_property
    def sparse_table(self) -> csr_array:
        """The table as a sparse matrix (see `compress`)."""
        return self.compress(self.table, [self.patterns] * len(self.kernel))

    def compress(self, rows: Array, counts: list[int]) -> csr_array:
        """Return a sparse matrix of rows of G, given as columns of shape (K,).

        `counts` has the number of rows of each component. The columns of the result are the steps
        to neighbours from the lowest one, in ascending order.
        """
        ends = pairwise(np.cumsum([0, *counts]))
        order = np.argsort(self.steps, axis=1)
        steps: Array = np.take_along_axis(self.steps, order, axis=1).astype(np.int32)
        steps -= steps[:, :1]
        rows = np.concatenate([rows[o, i:j].T for o, (i, j) in zip(order, ends, strict=True)])
        columns = np.concatenate([np.tile(s, m) for s, m in zip(steps, counts, strict=True)])
        known, K = rows != 0.0, rows.shape[1]
        starts = np.append(np.int32(0), np.cumsum(known, dtype=np.int32)[K - 1 :: K])
        where = np.flatnonzero(known)
        shape = (len(rows), int(steps.max()) + 1)
        return csr_array((rows.take(where), columns.take(where), starts), shape)

    @cached_property
    def full_load(self) -> tuple[Array, ...]:
        """The load Gᵀ w of a fully active aggregate on its window, for each component.

        Only the load in its own component is included; that in the other is less than a tenth.
        """
        loads = []
        w, index = np.full((AGGREGATE, 1), AGGREGATE**-0.5), np.zeros((AGGREGATE, 1), int)
        for near in self.near:
            smallest = float(np.linalg.eigvalsh(near.local)[0])
            require_positive("an eigenvalue of a neighbourhood is", smallest)
            row = np.linalg.inv(near.local)[: len(self.grid.steps), :1]
            row /= np.sqrt(row[0])
            loads.append(add_loads(self.grid, row, index, w).ravel())
            require_positive("the load of an aggregate is", float(loads[-1].sum()))
        return tuple(loads)

    @cached_property
    def totals(self) -> tuple[float, ...]:
        """The sum of `full_load` in each component."""
        return tuple(float(load.sum()) for load in self.full_load)

    @cached_property
    def coarser(self) -> "Stencil":
        """The stencil of E, with the coefficients between fully active aggregates."""
        K = self.coarsen(self.kernel, range(self.grid.blocks[0]), 0, self.kernel.shape[2])
        return Stencil(K, self.coarse_neighbours, self.coarse_neighbours)

    def coarsen(self, kernel: Array, blocks: range, first: int, stop: int) -> Array:
        """Return the coefficients of E for some lags in the first axis, counted in blocks.

        Parameters
        ----------
        kernel : ndarray of shape (d, d, rows, n2)
            Coefficients from the row `first` on, as far as blocks with these lags need them.
        blocks : range
        first, stop : int
            Beyond the row before `stop` all rows are equal to it.
        """
        grid, (m2, h2) = self.grid, (self.grid.blocks[1], self.grid.block[1])
        totals, h1 = np.array(self.totals), grid.block[0]
        K = average_over_blocks(kernel, 2, h1 * np.array(blocks, int), h1, first, stop)
        K = average_over_blocks(K, 3, h2 * np.arange(m2), h2, 0, kernel.shape[3])
        K = np.multiply.outer(totals, totals)[:, :, None, None] * K
        # Sum the products of loads by the lag between their cells.
        i1, i2 = np.array(grid.window_shape) - 1
        lags = np.indices((2 * i1 + 1, 2 * i2 + 1)).reshape(2, -1).T - (i1, i2)
        cell = grid.window_cells @ (2 * i2 + 1, 1)
        between = (cell[:, None] - cell + len(lags) // 2).ravel()
        exact = len(range(blocks.start, min(blocks.stop, EXACT))), min(m2, EXACT)
        here = np.indices(exact).reshape(2, -1).T
        shifted = (np.add(here, (blocks.start, 0)) * grid.block)[:, None] + lags
        for a, b in combinations_with_replacement(self.components, 2):
            loads = np.outer(self.full_load[a], self.full_load[b]).ravel()
            one = np.bincount(between, loads, len(lags)).reshape(2 * i1 + 1, 2 * i2 + 1)
            # Make these products even in the lags of each axis, so that E is even or odd like A.
            both = one + one[::-1]
            K[a, b, *here.T] = self.at(a, b, shifted) @ (both + both[:, ::-1]).ravel() / 4.0
            if a != b:
                # The coupling is odd in each axis.
                K[a, b, : int(blocks.start == 0)], K[a, b, :, 0] = 0.0, 0.0
                K[b, a] = K[a, b]
        return K


def average_over_blocks(
    kernel: Array, axis: int, lags: Array, h: int, first: int, stop: int
) -> Array:
    """Return the means over pairs of blocks of h cells along one axis, at these lags.

    The coefficients begin with the lag `first`; from `stop` on they equal the one before it.
    """
    means: Any = 0.0
    for k in range(1 - h, h):
        pairs = h - abs(k)  # The number of pairs of cells, one in each block, with this lag.
        near = np.minimum(np.abs(lags + k), stop - 1) - first
        means += kernel.take(near, axis) * (pairs / h**2)
    return means
