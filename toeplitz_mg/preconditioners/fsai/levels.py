"""The levels of a multilevel sparse approximate inverse on a mask, and their application."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrs, spotrs
from scipy.sparse import csr_array, vstack

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.small_matrices import factorise
from toeplitz_mg.engine.threads import WORTH_THREADS, share
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators.positivity import name_condition
from toeplitz_mg.preconditioners.fsai.rows import Refused, refusal
from toeplitz_mg.preconditioners.fsai.stencil import MOST_TABULATED, Stencil

BLOCK = 2**17  # Rows in a block of a sparse matrix: enough that threads do not wait.
# If the column ranges of all blocks together exceed this multiple of the columns, use one block.
WIDE = 1.5
STEPS = 8  # Steps of inverse iteration; the smallest eigenvalue is then known to some per cent.


@dataclass(frozen=True)
class LevelMatrix:
    """The matrix with the entries c_i K(i-j) c_j and the diagonal d, on the places of a `Stencil`.

    Attributes
    ----------
    c : ndarray
        The weight of each unknown; 0 where there is no unknown. On a coarse level it is the load,
        which is 1 for a fully active aggregate.
    d : ndarray
        The diagonal; 1 where there is no unknown.
    by_table : bool
        Whether it is A itself: then c is boolean, and the rows of G are taken from the table of
        patterns.
    """

    c: Array
    d: Array
    by_table: bool = False

    @classmethod
    def of_mask(cls, stencil: Stencil, mask: Array) -> "LevelMatrix":
        """Return the matrix for a mask of shape (n1, n2), or (2, n1, n2) for two components."""
        grids = mask.reshape(len(stencil.kernel), -1, stencil.grid.shape[1])
        active = np.concatenate([stencil.grid.place(grid, False) for grid in grids])
        matrix = cls(active, stencil.on_places(stencil.zero), True)
        # With more neighbours there are too many patterns for a table.
        return matrix if stencil.neighbours <= MOST_TABULATED else matrix.without_table()

    def without_table(self) -> "LevelMatrix":
        """Return the same matrix, for which each row of G is computed separately."""
        return LevelMatrix(self.c.astype(np.float64), np.where(self.active, self.d, 1.0))

    @cached_property
    def active(self) -> Array:
        """Where there are unknowns."""
        return self.c.astype(bool, copy=False)

    @property
    def count(self) -> int:
        """The number of unknowns."""
        return int(np.count_nonzero(self.active))

    @cached_property
    def number(self) -> Array:
        """The number of the unknown at each place, in the order of the places."""
        return number_places(np.flatnonzero(self.active), len(self.c))


def number_places(at: Array, size: int) -> Array:
    """Return an array of length `size` with the index of each place in `at`, and 0 elsewhere."""
    number = np.zeros(size, np.int32)
    number[at] = np.arange(len(at), dtype=np.int32)
    return number


@dataclass(frozen=True)
class Direct:
    """The last level, solved by a Cholesky factor.

    Attributes
    ----------
    factor : ndarray of shape (N, N)
        The upper factor in Fortran order, which LAPACK need not copy.
    """

    factor: Array

    @classmethod
    def of(cls, matrix: Array, dtype: np.dtype[Any]) -> "Direct":
        """Factorise a matrix; the factor is applied in the precision `dtype`."""
        try:
            factor = factorise(matrix)
        except np.linalg.LinAlgError:
            smallest = float(np.linalg.eigvalsh(matrix)[0])
            raise refusal("an eigenvalue of the coarsest matrix is", smallest) from None
        exact = cls(np.asfortranarray(factor))
        require_definite(matrix, exact, dtype)
        return cls(exact.factor.astype(dtype, copy=False))

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns."""
        return (len(self.factor),)

    @property
    def multiplications(self) -> int:
        """The number of multiplications in one application."""
        return self.factor.size

    def __call__(self, x: Array) -> Array:
        """Apply the inverse to a vector, or to the columns of x."""
        solve = spotrs if self.factor.dtype == np.float32 else dpotrs
        return solve(self.factor, x)[0]

    def multiply(self, X: Array, out: Array) -> None:
        """Apply the inverse to the rows of `X`."""
        out[...] = self(X.T).T


def require_definite(matrix: Array, inverse: Callable[[Array], Array], dtype: Any) -> None:
    """Raise a LinAlgError if the inverse of the last matrix may be indefinite in this precision.

    The condition number is estimated from the 1-norm and some steps of inverse iteration.
    """
    size = float(np.abs(matrix).sum(axis=0).max())
    v = np.random.default_rng(0).standard_normal(len(matrix))
    for _ in range(STEPS):
        # Scaled by the size of the matrix, because the square of the inverse might overflow.
        v = size * inverse(v / np.linalg.norm(v))
    condition = float(np.linalg.norm(v))
    if why := name_condition(condition, dtype, "the coarsest matrix"):
        if np.dtype(dtype).char == "f":
            raise np.linalg.LinAlgError(f"{why}: use float64")
        raise Refused(why)


class Block(NamedTuple):
    """Some rows of a sparse matrix."""

    rows: slice
    columns: slice  # The columns from its first to its last entry.
    own: slice  # The part of these that no other block reaches.
    matrix: csr_array


class Blocks:
    """A sparse matrix in blocks of rows, which do not depend on the number of threads.

    Parameters
    ----------
    pieces : list of csr_array
        The rows, split as by `cut_rows`. Their arrays are taken over and changed.
    """

    def __init__(self, pieces: list[csr_array]) -> None:
        m = pieces[0].shape[1]
        self.nnz = sum(piece.nnz for piece in pieces)
        reach = np.empty((2, len(pieces)), int)

        def find_reach(some: range) -> None:
            for k in some:
                near = pieces[k].indices
                reach[:, k] = near.min(initial=m), near.max(initial=-1) + 1

        share(find_reach, len(pieces), self.nnz)
        first, stop = np.minimum(*reach), reach[1]
        if (stop - first).sum() > WIDE * m:
            # Rows that use another component would make a block reach half of all columns.
            pieces, first, stop = [vstack(pieces)], np.array([0]), np.array([m])
        begin = np.maximum(first, np.maximum.accumulate(np.append(0, stop[:-1]))).clip(max=stop)
        end = np.minimum.accumulate(np.append(first[1:], m)[::-1])[::-1].clip(begin, stop)
        cuts = np.cumsum([0, *(piece.shape[0] for piece in pieces)])
        self.shape = int(cuts[-1]), m
        self._blocks: list[Any] = [None] * len(pieces)

        def cut_columns(some: range) -> None:
            for k in some:
                near = pieces[k].indices
                near -= near.dtype.type(first[k])
                arrays = pieces[k].data, near, pieces[k].indptr
                block = csr_array(arrays, (pieces[k].shape[0], stop[k] - first[k]))
                parts = cuts[k : k + 2], (first[k], stop[k]), (begin[k], end[k])
                rows, columns, own = (slice(int(i), int(j)) for i, j in parts)
                self._blocks[k] = Block(rows, columns, own, block)

        share(cut_columns, len(pieces), self.nnz)

    def tocsr(self) -> csr_array:
        """Return the matrix in one piece."""
        blocks = self._blocks
        near = [block.matrix.indices + block.columns.start for block in blocks]
        counts = np.concatenate([np.diff(block.matrix.indptr) for block in blocks])
        data = np.concatenate([block.matrix.data for block in blocks])
        starts = np.concatenate([[0], np.cumsum(counts)])
        return csr_array((data, np.concatenate(near), starts), self.shape)

    def toarray(self) -> Array:
        """Return the dense matrix."""
        return self.tocsr().toarray()

    def multiply(self, x: Array, y: Array, *, add: bool = False) -> None:
        """Write the product with a vector, or with the columns of x, to y, or add it to y."""

        def work(blocks: range) -> None:
            for block in self._blocks[blocks.start : blocks.stop]:
                product = block.matrix @ x[block.columns]
                if add:
                    y[block.rows] += product
                else:
                    y[block.rows] = product

        share(work, len(self._blocks), self.nnz)

    def multiply_transposed(self, y: Array, x: Array) -> None:
        """Write the product of the transpose with y, or with its columns, to x."""
        shared: list[Any] = [None] * len(self._blocks)

        def work(blocks: range) -> None:
            for k in blocks:
                rows, columns, own, matrix = self._blocks[k]
                product = matrix.T @ y[rows]
                start, stop = own.start - columns.start, own.stop - columns.start
                x[own] = product[start:stop]
                # Copy only the rest, because all products together would take much memory.
                shared[k] = product[:start].copy(), product[stop:].copy()

        share(work, len(self._blocks), self.nnz)
        # Columns that several blocks reach are summed here, in the order of the blocks.
        done = 0
        for block in self._blocks:
            x[done : block.own.start] = 0.0
            done = block.own.stop
        x[done:] = 0.0
        for (_, columns, own, _), (before, behind) in zip(self._blocks, shared, strict=True):
            x[columns.start : own.start] += before
            x[own.stop : columns.stop] += behind


def cut_rows(count: int, entries: int) -> list[slice]:
    """Return blocks of rows that threads share; a small matrix is one block."""
    # On slabs a rank may have no rows; it has one empty block.
    size = BLOCK if count * entries >= WORTH_THREADS else max(count, 1)
    return [slice(k, min(k + size, count)) for k in range(0, max(count, 1), size)]


class Level:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G, with the next level for E⁻¹.

    Parameters
    ----------
    G : list of csr_array
        The local factor, in blocks of rows; the rows are the unknowns in the order of their
        places. Its arrays, and those of W, are taken over.
    W : list of csr_array
        The tentative prolongator.
    coarse : Level or Direct, or an object with the same methods
    """

    def __init__(self, G: list[csr_array], W: list[csr_array], coarse: Any) -> None:
        self.G, self.W, self.coarse = Blocks(G), Blocks(W), coarse

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.G.shape[0], *self.coarse.sizes)

    @property
    def multiplications(self) -> int:
        """The number of multiplications in one application."""
        return 2 * int(self.G.nnz + self.W.nnz) + self.coarse.multiplications

    def multiply(self, X: Array, out: Array) -> None:
        """Apply the inverse to the rows of `X`, into `out`, which may be `X`."""
        self(X.T, out.T)

    def __call__(self, x: Array, out: Array | None = None, rows: Array | None = None) -> Array:
        """Apply the inverse to a vector, or to the columns of x, into `out`, which may be `x`.

        `rows` is an optional work vector with the length of the rows of G, which saves memory.
        """
        z = np.empty_like(x) if out is None else out
        y = workspace((self.G.shape[0], *x.shape[1:]), x.dtype) if rows is None else rows
        a = workspace((self.W.shape[1], *x.shape[1:]), x.dtype)
        self.G.multiply(x, y)
        self.W.multiply_transposed(y, a)
        self.W.multiply(self.coarse(a) - a, y, add=True)
        self.G.multiply_transposed(y, z)
        return z
