"""What a multilevel sparse approximate inverse takes from the kernel alone, for every mask.

The kernel is of one component, or of two that are coupled as `fsai_coupled` describes. The places
of the unknowns are those of the grid of cells, of one component after the other.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement, pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.cellgrid import AGGREGATE, CellGrid
from toeplitz_mg.preconditioners.positivity import for_smooth_kernels, require_condition

NEIGHBOURS = 12  # cells before a cell that its row of G sees: half of a 5 x 5 neighbourhood
STEPS = 8  # of inverse iteration, for the condition of the last matrix
EXACT = 3  # blocks: from this lag on the loads of two blocks are taken as uniform

# Of two components:
OTHERS = 2  # neighbours that a row of G sees in the other one too: 2 x 2^14 patterns fill int16
COARSE = 18  # neighbours on the levels above the finest, where they cost little


class Near(NamedTuple):
    """The matrix of the cells that a row of G sees, its own the first."""

    local: Array  # A less τ within a component, shape (K, K)
    zero: Array  # the diagonal of A, shape (K,)
    grid_shape: tuple[int, ...]  # of the whole grid, for errors


@dataclass(frozen=True)
class Stencil:
    """One level for a kernel: the rows of G, the loads of aggregates, the coarser kernel.

    Everything is computed where it is first asked for.

    Attributes
    ----------
    T : ndarray of shape (d, d, n1, n2)
        Coefficients of d = 1 or 2 components, those of a component even in both axes, those
        between the two odd in both; one level is 1 x n.
    neighbours : int
        Cells before a cell that its row of G sees.
    """

    T: Array
    neighbours: int = field(default_factory=lambda: NEIGHBOURS)

    @classmethod
    def of(cls, T: Array, neighbours: int | None = None) -> "Stencil":
        """Return that of one component, T of shape (n1, n2)."""
        return cls(T[None, None], NEIGHBOURS if neighbours is None else neighbours)

    @cached_property
    def grid(self) -> CellGrid:
        """That of either component: neighbours and aggregates are those of the mean."""
        T = self.T[0, 0] if len(self.T) == 1 else (self.T[0, 0] + self.T[1, 1]) / 2.0
        return CellGrid(T, self.neighbours)

    @cached_property
    def components(self) -> range:
        """The numbers of the components."""
        return range(len(self.T))

    @cached_property
    def zero(self) -> Array:
        """The diagonal of A in each component."""
        return self.T[self.components, self.components, 0, 0]

    def on_places(self, values: Array) -> Array:
        """Return numbers of the components on all of their places; of one a view."""
        size = self.grid.size
        return np.broadcast_to(values[:, None], (len(values), size)).reshape(-1)

    def split(self, at: Array) -> list[Array]:
        """Return these places of each component, those of the first before those of the second."""
        ends = [*at.searchsorted([a * self.grid.size for a in self.components[1:]]), len(at)]
        return [at[start:end] for start, end in pairwise([0, *ends])]

    @cached_property
    def others(self) -> Array:
        """Which of the neighbours a row sees in the other component too: the most coupled."""
        if len(self.T) == 1:
            return np.zeros(0, int)
        return np.argsort(-np.abs(self.at(0, 1, self.grid.offsets)), kind="stable")[:OTHERS]

    @cached_property
    def steps(self) -> Array:
        """From an unknown of each component to those that its row of G sees, shape (d, K)."""
        own, other = self.grid.steps, self.grid.steps[self.others]
        return np.array([[*own, *(other + s * self.grid.size)] for s in (1, -1)][: len(self.T)])

    def at(self, a: Any, b: Any, k: Array) -> Array:
        """Return T between components at lags of shape (..., 2); beyond the grid its last."""
        n1, n2 = self.T.shape[2:]
        i, j = k[..., 0], k[..., 1]
        value = self.T[a, b, np.minimum(np.abs(i), n1 - 1), np.minimum(np.abs(j), n2 - 1)]
        if len(self.T) == 1:
            return np.asarray(value)
        return np.asarray(np.where(np.equal(a, b), value, np.sign(i) * np.sign(j) * value))

    def matrix(self, places: Array) -> Array:
        """Return A among the unknowns of these places."""
        component, cell = np.divmod(places, self.grid.size)
        i, j = np.divmod(cell, self.grid.padded[1])
        d, n1, n2 = self.T.shape[1:]
        lag = np.abs(i[:, None] - i) * n2 + np.abs(j[:, None] - j)
        if d == 1:
            return np.asarray(self.T.take(lag))
        A = self.T.take(lag + (d * component[:, None] + component) * (n1 * n2))
        between = component[:, None] != component
        A[between] *= (np.sign(i[:, None] - i) * np.sign(j[:, None] - j))[between]
        return np.asarray(A)

    @cached_property
    def far(self) -> float:
        """The coefficient τ twice as far as the neighbours are, which they see as a constant."""
        T = self.grid.kernel
        beyond = [min(2 * p + 2, n - 1) for p, n in zip(self.grid.reach, T.shape, strict=True)]
        ends = [(T[beyond[0], 0], beyond[0]), (T[0, beyond[1]], beyond[1])]
        return min((float(value) for value, lag in ends if lag > 0), default=0.0)

    @cached_property
    def near(self) -> tuple[Near, ...]:
        """What a row of G sees, in each component."""
        offsets, result = self.grid.offsets, []
        cells = np.concatenate([offsets, offsets[self.others]])
        for a in self.components:
            b = np.repeat([a, 1 - a], [len(offsets), len(self.others)])
            S = self.at(b[:, None], b, cells[:, None] - cells)
            S -= self.far * np.equal.outer(b, b)
            result.append(Near(S, self.zero[b], self.T.shape[2:]))
        return tuple(result)

    @cached_property
    def own(self) -> tuple[Array, ...]:
        """A of each component among the cells of one window."""
        cells = self.grid.window_cells
        return tuple(self.at(a, a, cells[:, None] - cells) for a in self.components)

    @cached_property
    def patterns(self) -> int:
        """The number of patterns of neighbours, the last of them that of full contact."""
        return int(2 ** (self.steps.shape[1] - 1))

    @cached_property
    def table(self) -> Array:
        """Rows of G for A itself by component and pattern: bit k - 1 says if k is in contact.

        Columns of shape (K,), zero where there is no contact.
        """
        return np.hstack([rows_by_pattern(near) for near in self.near])

    @cached_property
    def table_sums(self) -> Array:
        """Products of the rows in the table with ones in their own component, and the other."""
        return self.sums(self.table, np.ones((len(self.table), 1)))

    def sums(self, rows: Array, c: Array) -> Array:
        """Return products of columns with c in their own component, and the other: (d, any)."""
        K = len(self.grid.steps)
        parts = (slice(0, K), slice(K, None))[: len(self.T)]
        return np.stack([np.einsum("km,km->m", *np.broadcast_arrays(rows[k], c[k])) for k in parts])

    @cached_property
    def sparse_table(self) -> csr_array:
        """The same as of `sparse`."""
        return self.sparse(self.table, [self.patterns] * len(self.T))

    def sparse(self, rows: Array, counts: list[int]) -> csr_array:
        """Return a matrix of rows of G, without their zeros, so many of each component.

        Its columns are `steps` from the lowest on.
        """
        rows = np.ascontiguousarray(rows.T)
        known, K = rows != 0.0, rows.shape[1]
        starts = np.append(np.int32(0), np.cumsum(known, dtype=np.int32)[K - 1 :: K])
        steps: Array = (self.steps - self.steps.min(axis=1, keepdims=True)).astype(np.int32)
        where = np.flatnonzero(known)
        columns = np.concatenate([np.tile(s, m) for s, m in zip(steps, counts, strict=True)])
        shape = (len(rows), int(steps.max()) + 1)
        return csr_array((rows.take(where), columns.take(where), starts), shape)

    @cached_property
    def full_load(self) -> tuple[Array, ...]:
        """The load Gᵀ w of an aggregate in full contact, in each component, on its window.

        In its own component only: what acts in the other is less than a tenth.
        """
        loads = []
        w, index = np.full((AGGREGATE, 1), AGGREGATE**-0.5), np.zeros((AGGREGATE, 1), int)
        for near in self.near:
            smallest = float(np.linalg.eigvalsh(near.local)[0])
            check("an eigenvalue of a neighbourhood is", smallest, near.grid_shape)
            row = np.linalg.inv(near.local)[: len(self.grid.steps), :1]
            row /= np.sqrt(row[0])
            loads.append(block_loads(self.grid, row, index, w).ravel())
            check("the load of an aggregate is", float(loads[-1].sum()), near.grid_shape)
        return tuple(loads)

    @cached_property
    def totals(self) -> tuple[float, ...]:
        """The sums of these loads."""
        return tuple(float(load.sum()) for load in self.full_load)

    @cached_property
    def coarser(self) -> "Stencil":
        """The same for E, whose coefficients are those of aggregates in full contact."""
        grid, T = self.grid, self.T
        totals = np.array(self.totals)
        for axis, (m, h) in enumerate(zip(grid.blocks, grid.block, strict=True)):
            T = averaged(T, axis + 2, m, h)
        T = np.multiply.outer(totals, totals)[:, :, None, None] * T
        # The loads' products by the lag between their cells.
        first, second = np.array(grid.window_shape) - 1
        lags = np.indices((2 * first + 1, 2 * second + 1)).reshape(2, -1).T - (first, second)
        cell = grid.window_cells @ (2 * second + 1, 1)
        between = (cell[:, None] - cell + len(lags) // 2).ravel()
        near = np.indices([min(m, EXACT) for m in grid.blocks]).reshape(2, -1).T
        shifted = (near * grid.block)[:, None] + lags
        for a, b in combinations_with_replacement(self.components, 2):
            loads = np.outer(self.full_load[a], self.full_load[b]).ravel()
            one = np.bincount(between, loads, len(lags)).reshape(2 * first + 1, 2 * second + 1)
            both = one + one[::-1]  # of lags in either axis: even or odd, as A
            T[a, b, *near.T] = self.at(a, b, shifted) @ (both + both[:, ::-1]).ravel() / 4.0
            if a != b:
                T[a, b, 0], T[a, b, :, 0] = 0.0, 0.0  # odd
                T[b, a] = T[a, b]
        return Stencil(T) if len(T) == 1 else Stencil(T, COARSE)


def rows_by_pattern(near: Near) -> Array:
    """Return the rows of G for every pattern of neighbours in contact, columns of shape (K,).

    The farthest neighbours are eliminated first, from all patterns that have the same ones among
    them together.
    """
    S = near.local[:, :, None]
    eliminated = []
    for k in range(len(S) - 1, 0, -1):
        check("a pivot is", S[k, k].min(), near.grid_shape)
        factors = S[k, :k] / S[k, k]
        without, S = S[:k, :k], S[:k, :k] - factors[:, None] * S[k, :k]
        S = np.stack([without, S], axis=-1).reshape(k, k, -1)
        eliminated.append(np.stack([np.zeros(factors.shape), factors], axis=-1))
    check("a pivot is", S.min(), near.grid_shape)
    rows = np.empty((len(near.local), S.size))
    rows[0] = 1.0 / np.sqrt(S[0, 0])
    for k, factors in enumerate(reversed(eliminated), 1):
        factors = factors.reshape(k, -1)
        known = rows[:k].reshape(k, factors.shape[1], -1)
        rows[k] = -np.einsum("js,jsr->sr", factors, known).ravel()
    return rows


def block_loads(grid: CellGrid, rows: Array, index: Array, w: Array) -> Array:
    """Return Gᵀ w on the windows of blocks, shape (window, m).

    Parameters
    ----------
    grid : CellGrid
    rows : ndarray of shape (K, any)
        Columns of rows of G.
    index : ndarray of int, shape (h1 h2, m)
        For each cell of the blocks the place of its row.
    w : ndarray of shape (h1 h2, m)
        Zero in cells that are not in contact.
    """
    (h1, h2), (p1, p2) = grid.block, grid.reach
    loads = np.zeros((*grid.window_shape, w.shape[1]))
    index = index.astype(np.intp, copy=False)
    for g, (a, b) in zip(rows, grid.offsets, strict=True):
        part = loads[p1 + a : p1 + a + h1, p2 + b : p2 + b + h2]
        part += (g.take(index) * w).reshape(part.shape)
    return loads.reshape(len(grid.window), w.shape[1])


def averaged(T: Array, axis: int, m: int, h: int) -> Array:
    """Return the means of T over pairs of blocks of h cells in one axis, for m lags of blocks."""
    lags = h * np.arange(m)
    means: Any = 0.0
    for k in range(1 - h, h):
        pairs = h - abs(k)  # of cells, one in either block, with each lag
        means += T.take(np.minimum(np.abs(lags + k), T.shape[axis] - 1), axis) * (pairs / h**2)
    return np.asarray(means)


def check(subject: str, value: float, grid_shape: tuple[int, ...]) -> None:
    """Refuse a kernel for which a number that must be positive is not."""
    if not value > 0.0:
        raise refused(subject, value, grid_shape)


def refused(subject: str, value: float, grid_shape: tuple[int, ...]) -> np.linalg.LinAlgError:
    """Return the error of a kernel for which the construction fails."""
    return np.linalg.LinAlgError(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        f"positive definite, or too smooth a kernel for it; {for_smooth_kernels(grid_shape)}"
    )


def require_definite(matrix: Array, inverse: Callable[[Array], Array], dtype: Any) -> None:
    """Raise LinAlgError where the inverse of the last matrix may be indefinite in this precision.

    By its 1-norm, and some steps of inverse iteration.
    """
    v = np.random.default_rng(0).standard_normal(len(matrix))
    for _ in range(STEPS):
        v = inverse(v / np.linalg.norm(v))
    condition = float(np.abs(matrix).sum(axis=0).max() * np.linalg.norm(v))
    require_condition(condition, dtype, "the coarsest matrix", "sine_preconditioner(A)")
