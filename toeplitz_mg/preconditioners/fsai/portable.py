"""A multilevel sparse approximate inverse, built for NumPy's arrays, on those of another library.

The sparse matrices have at most so many entries in each row, and so have their transposes: of each
row the first entries are a vector, the second ones another, and so on. A product multiplies them
with the numbers that they see, and needs no sparse matrices of the library.
"""

from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.library import Library
from toeplitz_mg.operators import BlockDiagonal, GridOperator
from toeplitz_mg.preconditioners.fsai.levels import Direct


class EntriesInTurn:
    """A sparse matrix as vectors of entries.

    Parameters
    ----------
    library : Library
    matrix : csr_array
    """

    def __init__(self, library: Any, matrix: csr_array) -> None:
        self._library, self._entries = library, []
        lengths, self._rows = np.diff(matrix.indptr), matrix.shape[0]
        for k in range(max(1, int(lengths.max(initial=0)))):
            at = np.minimum(matrix.indptr[:-1] + k, max(0, matrix.nnz - 1))
            entries = np.where(k < lengths, matrix.data[at], 0)
            columns = np.where(k < lengths, matrix.indices[at], 0).astype(np.int32)
            self._entries.append((library.from_numpy(entries), library.from_numpy(columns)))

    def __call__(self, x: Any) -> Any:
        """Return the product with a vector."""
        y = None
        for entries, columns in self._entries:
            part = self._library.xp.take(x, columns)
            part *= entries
            y = part if y is None else y + part
        return y


class PortableLevel:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G (see `levels.Level`)."""

    def __init__(self, library: Any, level: Any) -> None:
        G, W = level.G.tocsr(), level.W.tocsr()
        self._G, self._to_G = (EntriesInTurn(library, a) for a in (G, G.T.tocsr()))
        self._W, self._to_W = (EntriesInTurn(library, a) for a in (W, W.T.tocsr()))
        self._coarse = bring(library, level.coarse)

    def __call__(self, x: Any) -> Any:
        """Apply the inverse to a vector."""
        y = self._G(x)
        a = self._to_W(y)
        y += self._W(self._coarse(a) - a)
        return self._to_G(y)


def bring(library: Any, level: Any) -> Any:
    """Return what applies a level, and those below it, on arrays of a library."""
    if not isinstance(level, Direct):
        return PortableLevel(library, level)
    inverse = level(np.eye(len(level.factor), dtype=level.factor.dtype))
    matrix = library.from_numpy(np.ascontiguousarray(inverse))
    return partial(_multiply, library, matrix)


def _multiply(library: Any, matrix: Any, x: Any) -> Any:
    return library.xp.matmul(matrix, x)


class PortableSparseInverse(GridOperator):
    """What `MultilevelSparseInverse` is, on arrays of another library.

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
    """Return a preconditioner of this package that was built for NumPy's arrays on others."""
    if isinstance(host, BlockDiagonal):
        return BlockDiagonal([on_library(library, b) for b in host.blocks], host.grid_shape)
    return PortableSparseInverse(library, host)
