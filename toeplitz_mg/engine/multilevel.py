"""Products with Toeplitz matrices on several axes, whose entries may be small matrices.

Each line along the last axis is transformed as in `products.ToeplitzProduct`, at the frequencies
k + 1/4, without an extension by zeros. For each frequency, a Toeplitz matrix on the other axes
remains, and these are extended by zeros. The passes depend on the array library:
`passes.PanelPasses` for NumPy, `arrays.passes.PlainPasses` for others.

If the matrix is complex, the imaginary part cannot separate the entries that wrap around. The last
axis is then extended by zeros too, and transformed at the frequencies k.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import norm

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.embedding import embed
from toeplitz_mg.engine.lengths import embedding_lengths

# The coefficients, or the eigenvalues, for each pair of components; None if they are all zero.
Blocks = Sequence[Sequence[Any]]


class MultilevelProduct:
    """Multiplication by a Toeplitz matrix with several axes, or by a block matrix of these.

    Parameters
    ----------
    library : Library
        The array library.
    grid_shape : tuple of int
        (components, n₁, ..., n_d).
    dtype : float32, float64, complex64 or complex128
        The dtype of the matrix. Real and complex matrices are embedded differently.
    blocks : sequence of sequences of Coefficients or None
        For each pair (i, j), the block that maps component j of the vector to component i of the
        result. The vectors contain one component after the other. Only small products, which are
        dense, need the blocks.
    spectrum : sequence of sequences of ndarray or None
        For each pair of components, the eigenvalues of the embedding, divided by the lengths of the
        inverse transforms. None as a whole if the product is dense.
    """

    def __init__(
        self,
        library: Any,
        grid_shape: tuple[int, ...],
        dtype: DTypeLike,
        blocks: Blocks | None,
        spectrum: Blocks | None,
    ) -> None:
        self.library, self.grid_shape, self.dtype = library, grid_shape, np.dtype(dtype)
        self.points = float(prod(grid_shape))
        self._blocks = blocks
        self.lengths = embedding_lengths(grid_shape[1:], is_complex=self.dtype.kind == "c")
        self.passes: Any = None
        if spectrum is not None:
            self.passes = library.passes(grid_shape, self.dtype, self.lengths, spectrum)

    @classmethod
    def of(
        cls, library: Any, blocks: Blocks, dtype: DTypeLike, known: Blocks | None = None
    ) -> "MultilevelProduct":
        """Return the product, constructed from the coefficients for each pair of components.

        Parameters
        ----------
        library, blocks, dtype
            As for the class.
        known : sequence of sequences of ndarray or None, optional
            For each pair of components, eigenvalues taken from another product, or None if they
            have to be computed.
        """
        grid_shape = (len(blocks), *next(a.grid_shape for row in blocks for a in row if a))
        if prod(grid_shape) <= library.dense:
            return cls(library, grid_shape, dtype, blocks, None)
        known = known or [[None] * len(row) for row in blocks]
        is_complex = np.dtype(dtype).kind == "c"

        def spectrum(a: Any, given: Any) -> Any:
            if given is not None:
                return library.cast_numbers(given, dtype)
            is_zero = a is None or not library.xp.any(a.array != 0.0)
            return None if is_zero else embed(library, a, is_complex, dtype)

        spectra = [
            [spectrum(a, given) for a, given in zip(*row, strict=True)]
            for row in zip(blocks, known, strict=True)
        ]
        return cls(library, grid_shape, dtype, None, spectra)

    @property
    def spectrum(self) -> Blocks | None:
        """The eigenvalues for each pair of components, or None if the product is dense."""
        return self.passes and self.passes.spectrum

    def adjoint(self) -> "MultilevelProduct":
        """Return the multiplication by the conjugate transpose, without any transform."""

        def turned(change: Callable[[Any], Any], rows: Any) -> Any:
            return rows and _map(change, zip(*rows, strict=True))

        blocks = turned(lambda a: a.transpose.conjugate, self._blocks)
        spectra = turned(self.library.conj, self.spectrum)
        return MultilevelProduct(self.library, self.grid_shape, self.dtype, blocks, spectra)

    def astype(self, dtype: DTypeLike) -> "MultilevelProduct":
        """Return the multiplication in another precision, without any transform."""
        cast = self.library.cast_numbers
        spectra = self.spectrum and _map(lambda s: cast(s, dtype), self.spectrum)
        return MultilevelProduct(self.library, self.grid_shape, dtype, self._blocks, spectra)

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm, from the largest eigenvalues of the blocks."""
        xp, is_complex = self.library.xp, self.dtype.kind == "c"
        spectra = self.spectrum or _map(
            lambda a: embed(self.library, a, is_complex, self.dtype), self._blocks or ()
        )
        sizes = _map(lambda s: float(xp.max(xp.abs(s))) if prod(s.shape) else 0.0, spectra)
        # SciPy's norm scales numbers before it squares them, so that none overflow.
        return float(norm([size or 0.0 for row in sizes for size in row])) * prod(self.lengths)

    @cached_property
    def _matrix(self) -> Array:
        """The transpose of the dense matrix, because vectors are rows."""
        grid = self.grid_shape[1:]
        points = np.indices(grid).reshape(len(grid), -1)
        zero = np.zeros((points.shape[1],) * 2)
        blocks = [
            [zero if a is None else entries(a.lags, points, points) for a in row]
            for row in self._blocks or ()
        ]
        return np.ascontiguousarray(np.block(blocks).T, self.dtype)

    def __call__(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, shape (..., N) (see `products.multiply_rows`)."""
        return self.library.multiply_rows(self, X, out)

    def multiply(self, X: Any, out: Any) -> Any:
        """Multiply the rows of `X`, of shape (rows, N), into `out` (see `products.Product`)."""
        if self.passes is None:
            out[...] = X.astype(self.dtype, copy=False) @ self._matrix
            return out
        return self.passes.multiply(X, out)


def _map(change: Callable[[Any], Any], blocks: Any) -> list[list[Any]]:
    """Return the blocks, with `change` applied to all that are not None."""
    return [[None if block is None else change(block) for block in row] for row in blocks]


def entries(lags: Array, rows: Sequence[Array] | Array, columns: Sequence[Array] | Array) -> Array:
    """Return a[i - j] for all pairs of points, given by their indices on each axis."""
    lag = (
        np.subtract.outer(i, j) + m // 2 for i, j, m in zip(rows, columns, lags.shape, strict=True)
    )
    return lags[tuple(lag)]
