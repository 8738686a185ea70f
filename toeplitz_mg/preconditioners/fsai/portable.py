"""A multilevel sparse approximate inverse, built with NumPy, applied to arrays of another library.

The rows of the sparse matrices have a bounded number of entries, and so have their columns. So a
matrix is stored as vectors: the first entries of all rows, the second entries, and so on. A product
gathers the factors and multiplies elementwise, without sparse matrices of the library. The
transpose stores only the places of its entries, which also determine the factors.
"""

from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import Library
from toeplitz_mg.operators import BlockDiagonal, GridOperator
from toeplitz_mg.preconditioners.fsai.levels import Direct


class EntriesInTurn:
    """A sparse matrix as vectors of entries, and its transpose as the places of the entries.

    Parameters
    ----------
    library : Library
    matrix : csr_array
    """

    def __init__(self, library: Any, matrix: csr_array) -> None:
        self._take, self._n = library.xp.take, max(1, matrix.shape[0])
        places = _places(matrix)
        size = self._n * _most(matrix)
        # Missing entries of a row, or of a row of the transpose, point to the zero at the end.
        entries, seen = np.zeros(size + 1, matrix.dtype), np.zeros(size, np.int32)
        entries[places], seen[places] = matrix.data, matrix.indices
        self._entries = library.from_numpy(entries)
        self._columns = [library.from_numpy(columns) for columns in seen.reshape(-1, self._n)]
        transpose = csr_array((places, matrix.indices, matrix.indptr), matrix.shape).tocsc().T
        of_transpose = np.full((_most(transpose), max(1, matrix.shape[1])), size, places.dtype)
        of_transpose.reshape(-1)[_places(transpose)] = transpose.data
        self._places = [library.from_numpy(places) for places in of_transpose]

    def multiply(self, x: Any) -> Any:
        """Return the product with a vector."""
        y = None
        for k, columns in enumerate(self._columns):
            part = self._take(x, columns)
            part *= self._entries[k * self._n : (k + 1) * self._n]
            y = part if y is None else y + part
        return y

    def multiply_transposed(self, y: Any) -> Any:
        """Return the product of the transpose with a vector."""
        x = None
        for places in self._places:
            part = self._take(self._entries, places)
            part *= self._take(y, places % self._n)
            x = part if x is None else x + part
        return x


def _most(matrix: csr_array) -> int:
    """Return the largest number of entries in a row."""
    return max(1, int(np.diff(matrix.indptr).max(initial=0)))


def _places(matrix: csr_array) -> Array:
    """Return the place of each entry: first entries of all rows, then second entries, …."""
    n, lengths = max(1, matrix.shape[0]), np.diff(matrix.indptr)
    small = np.int32 if n * _most(matrix) < 2**31 else np.int64
    places = np.arange(matrix.nnz, dtype=small)
    places -= np.repeat(matrix.indptr[:-1].astype(small), lengths)
    places *= n
    places += np.repeat(np.arange(matrix.shape[0], dtype=small), lengths)
    return places


class PortableLevel:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G (see `levels.Level`)."""

    def __init__(self, library: Any, level: Any) -> None:
        self._G, self._W = (EntriesInTurn(library, a.tocsr()) for a in (level.G, level.W))
        self._coarse = bring(library, level.coarse)

    def __call__(self, x: Any) -> Any:
        """Apply the inverse to a vector."""
        y = self._G.multiply(x)
        a = self._W.multiply_transposed(y)
        y += self._W.multiply(self._coarse(a) - a)
        return self._G.multiply_transposed(y)


def bring(library: Any, level: Any) -> Any:
    """Return a function that applies a level, and those below it, to arrays of a library."""
    if not isinstance(level, Direct):
        return PortableLevel(library, level)
    inverse = level(np.eye(len(level.factor), dtype=level.factor.dtype))
    matrix = library.from_numpy(np.ascontiguousarray(inverse))
    return partial(_multiply, library, matrix)


def _multiply(library: Any, matrix: Any, x: Any) -> Any:
    return library.xp.matmul(matrix, x)


class PortableSparseInverse(GridOperator):
    """`MultilevelSparseInverse` for arrays of another library.

    Attributes
    ----------
    sizes : tuple of int
        The number of unknowns on each level.
    """

    def __init__(self, library: Library, host: Any) -> None:
        super().__init__(host.dtype, host.grid_shape, host.work, host.shape[0], library)
        self.points, self.sizes = host.points, host.sizes
        self._level = bring(library, host.level)

    def multiply(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, in the precision of the matrix."""
        rows = [self._level(X[k, ...]) for k in range(X.shape[0])]
        return self.library.xp.stack(rows)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self.library.multiply_rows(self, X, out)

    def __repr__(self) -> str:
        sizes = " > ".join(map(str, self.sizes))
        return f"<PortableSparseInverse {sizes} (direct), {self.library.name}, {self.dtype}>"


def on_library(library: Library, host: Any) -> GridOperator:
    """Return a preconditioner, built with NumPy, for arrays of another library."""
    if isinstance(host, BlockDiagonal):
        return BlockDiagonal([on_library(library, b) for b in host.blocks], host.grid_shape)
    return PortableSparseInverse(library, host)
