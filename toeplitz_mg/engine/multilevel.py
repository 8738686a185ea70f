"""Products with Toeplitz matrices of several axes, whose entries may be small matrices.

Each line along the last axis is transformed as in `products.ToeplitzProduct`, at the frequencies
k + 1/4, without an extension by zeros. What is left for each frequency is a Toeplitz matrix of the
other axes, which are extended by zeros. These passes are those of the library of the arrays:
`passes.PanelPasses` of NumPy's, `arrays.passes.PlainPasses` of others.

A complex matrix has no imaginary part to spare for what goes around: of it the last axis is
extended as the others are, and transformed at the frequencies k.
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

# The coefficients, or the eigenvalues, of each pair of components; None where they are zero.
Blocks = Sequence[Sequence[Any]]


class MultilevelProduct:
    """Multiplication by a Toeplitz matrix of several axes, or by blocks of such.

    Parameters
    ----------
    library : Library
        That of the arrays.
    grid_shape : tuple of int
        (components, n₁, ..., n_d).
    dtype : float32, float64, complex64 or complex128
        That of the matrix: whether it is complex decides how it is embedded.
    blocks : sequence of sequences of Coefficients or None
        For each pair of components (i, j) what takes component j of the vector to component i of
        the result. The vectors have the components one after the other. It is needed only where
        the product is small, and so a dense one.
    spectrum : sequence of sequences of ndarray or None
        For each pair of components the eigenvalues of the embedding, divided by the lengths of the
        inverse transforms; None in the place of all where the product is a dense one.
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
        """Make the product from the coefficients of each pair of components.

        Parameters
        ----------
        library, blocks, dtype
            Parameters of the class.
        known : sequence of sequences of ndarray or None, optional
            For each pair of components the eigenvalues that another product has, if one has them;
            None where they have to be computed.
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
        """The eigenvalues of each pair of components; None where the product is a dense one."""
        return self.passes and self.passes.spectrum

    def adjoint(self) -> "MultilevelProduct":
        """Return the multiplication by the conjugate transpose; no transform is made."""

        def turned(change: Callable[[Any], Any], rows: Any) -> Any:
            return rows and _map(change, zip(*rows, strict=True))

        blocks = turned(lambda a: a.transpose.conjugate, self._blocks)
        spectra = turned(self.library.conj, self.spectrum)
        return MultilevelProduct(self.library, self.grid_shape, self.dtype, blocks, spectra)

    def astype(self, dtype: DTypeLike) -> "MultilevelProduct":
        """Return the multiplication in another precision; no transform is made."""
        cast = self.library.cast_numbers
        spectra = self.spectrum and _map(lambda s: cast(s, dtype), self.spectrum)
        return MultilevelProduct(self.library, self.grid_shape, dtype, self._blocks, spectra)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm, by the largest eigenvalues of the blocks."""
        xp, is_complex = self.library.xp, self.dtype.kind == "c"
        spectra = self.spectrum or _map(
            lambda a: embed(self.library, a, is_complex, self.dtype), self._blocks or ()
        )
        sizes = _map(lambda s: float(xp.max(xp.abs(s))) if prod(s.shape) else 0.0, spectra)
        # SciPy's norm scales what it squares, so that numbers of any size do not overflow.
        return float(norm([size or 0.0 for row in sizes for size in row])) * prod(self.lengths)

    @cached_property
    def _matrix(self) -> Array:
        """The transpose of the matrix, as vectors are rows."""
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
    """Change what is not None."""
    return [[None if block is None else change(block) for block in row] for row in blocks]


def entries(lags: Array, rows: Sequence[Array] | Array, columns: Sequence[Array] | Array) -> Array:
    """Return the a[i - j] of all pairs of points, which are given by their index on each axis."""
    lag = (
        np.subtract.outer(i, j) + m // 2 for i, j, m in zip(rows, columns, lags.shape, strict=True)
    )
    return lags[tuple(lag)]
