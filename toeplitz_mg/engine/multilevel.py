"""Products with Toeplitz matrices of several axes, whose entries may be small matrices.

Each line along the last axis is transformed as in `products.ToeplitzProduct`, at the frequencies
k + 1/4, without an extension by zeros. What is left for each frequency is a Toeplitz matrix of the
other axes. These are extended by zeros; the transforms skip the lines that are zero on the way in,
and those that are cut off on the way out. They work on a panel of some frequencies of the last axis
that stays in the cache.

A complex matrix has no imaginary part to spare for what goes around: of it the last axis is
extended as the others are, and transformed at the frequencies k.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import product as combinations
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft
from scipy.linalg import norm

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.products import DENSE, cast_numbers, multiply_rows
from toeplitz_mg.engine.threads import share
from toeplitz_mg.engine.transforms import in_batches, phase_factors
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.engine.workspace import workspace

# The coefficients, or the eigenvalues, of each pair of components; None where they are zero.
Kernel = Sequence[Sequence[Array | None]]

PANEL_BYTES = 2**20  # Bytes of a panel of frequencies of the last axis: it stays in the cache.
BLOCK_BYTES = 2**18  # Bytes of a block of lines along the last axis, which stays there too.
NARROW = 8  # Least frequencies of a panel: shorter pieces of a line take as long to copy.


class MultilevelProduct:
    """Multiplication by a Toeplitz matrix of several axes, or by blocks of such.

    Parameters
    ----------
    grid_shape : tuple of int
        (components, n₁, ..., n_d).
    dtype : float32, float64, complex64 or complex128
        That of the matrix: whether it is complex decides how it is embedded.
    kernel : sequence of sequences of ndarray or None
        For each pair of components (i, j) the lags, shape (2 n₁ - 1, ..., 2 n_d - 1), that take
        component j of the vector to component i of the result. The vectors have the components
        one after the other. It is needed only where the product is small, and so a dense one.
    spectrum : sequence of sequences of ndarray or None
        For each pair of components the eigenvalues of the embedding, divided by the lengths of the
        inverse transforms; None in the place of all where the product is a dense one.
    """

    def __init__(
        self,
        grid_shape: tuple[int, ...],
        dtype: DTypeLike,
        kernel: Kernel | None,
        spectrum: Kernel | None,
    ) -> None:
        self.grid_shape = grid_shape
        self.dtype, self.points = np.dtype(dtype), float(prod(grid_shape))
        self._components, *grid = grid_shape
        self._grid = tuple(grid)
        self._kernel = kernel
        self.spectrum = spectrum
        self._is_complex = self.dtype.kind == "c"
        self.lengths = embedding_lengths(self._grid, is_complex=self._is_complex)

    @classmethod
    def of(
        cls, kernel: Kernel, dtype: DTypeLike, known: Kernel | None = None
    ) -> "MultilevelProduct":
        """Make the product from the lags of each pair of components.

        Parameters
        ----------
        kernel, dtype
            Parameters of the class.
        known : sequence of sequences of ndarray or None, optional
            For each pair of components the eigenvalues that another product has, if one has them;
            None where they have to be computed.
        """
        first = next(lags for row in kernel for lags in row if lags is not None)
        grid_shape = (len(kernel), *((m + 1) // 2 for m in first.shape))
        if prod(grid_shape) <= DENSE:
            return cls(grid_shape, dtype, kernel, None)
        known = known or [[None] * len(row) for row in kernel]
        is_complex = np.dtype(dtype).kind == "c"
        spectrum = [
            [
                _cast(_spectrum(lags, is_complex) if given is None else given, dtype)
                for lags, given in zip(*row, strict=True)
            ]
            for row in zip(kernel, known, strict=True)
        ]
        return cls(grid_shape, dtype, None, spectrum)

    def adjoint(self) -> "MultilevelProduct":
        """Return the multiplication by the conjugate transpose; no transform is made."""
        kernel = self._kernel and _transpose(self._kernel, lambda lags: np.flip(lags).conj())
        spectrum = self.spectrum and _transpose(self.spectrum, np.conj)
        return MultilevelProduct(self.grid_shape, self.dtype, kernel, spectrum)

    def astype(self, dtype: DTypeLike) -> "MultilevelProduct":
        """Return the multiplication in another precision; no transform is made."""
        spectrum = self.spectrum and [[_cast(s, dtype) for s in row] for row in self.spectrum]
        return MultilevelProduct(self.grid_shape, dtype, self._kernel, spectrum)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm, by the largest eigenvalues of the blocks."""
        spectrum = self.spectrum or [
            [_spectrum(lags, self._is_complex) for lags in row] for row in self._kernel or ()
        ]
        sizes = [
            [0.0 if s is None else float(np.abs(s).max(initial=0.0)) for s in row]
            for row in spectrum
        ]
        # SciPy's norm scales what it squares, so that numbers of any size do not overflow.
        return float(norm(np.ravel(sizes))) * prod(self.lengths)

    @cached_property
    def _matrix(self) -> Array:
        """The transpose of the matrix, as vectors are rows."""
        points = np.indices(self._grid).reshape(len(self._grid), -1)
        zero = np.zeros((points.shape[1],) * 2)
        blocks = [
            [zero if lags is None else entries(lags, points, points) for lags in row]
            for row in self._kernel or ()
        ]
        return np.ascontiguousarray(np.block(blocks).T, self.dtype)

    __call__ = multiply_rows

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out` (see `products.Product`)."""
        if X.shape[1] <= DENSE:
            out[...] = X.astype(self.dtype, copy=False) @ self._matrix
            return
        in_batches(self._multiply, X, out, self._components * prod(self.lengths))

    def _multiply(self, X: Array, out: Array) -> None:
        n = self._grid[-1]
        Z = self.rows_in(X.reshape(-1, n))
        self.columns_through(Z.reshape(len(X), self._components, *self._grid[:-1], Z.shape[-1]))
        self.rows_out(Z, out.reshape(-1, n))

    def rows_in(self, x: Array) -> Array:
        """Transform lines along the last axis, shape (rows, n), to all frequencies, (rows, L)."""
        n, L, w = self._grid[-1], self.lengths[-1], self._phases
        Z = workspace((len(x), L), self.precision)
        height = max(1, BLOCK_BYTES // (L * Z.itemsize))

        def work(blocks: range) -> None:
            for rows in _slices(blocks, height, len(x)):
                R = Z[rows]
                if w is None:
                    R[:, :n] = x[rows]
                else:
                    np.multiply(x[rows], w, out=R[:, :n], casting="same_kind")
                R[:, n:] = 0.0
                _in_place(fft.fft, R, 1)

        share(work, -(-len(x) // height), Z.size)
        return Z

    def columns_through(self, matrix: Array, first: int = 0) -> None:
        """Multiply frequencies of the last axis by their matrices of the others, in place.

        Parameters
        ----------
        matrix : ndarray of shape (rows, components, n₁, ..., frequencies)
        first : int
            The place in the spectrum of the first of these frequencies.
        """
        count = matrix.shape[-1]
        line = len(matrix) * self._components * prod(self.lengths[:-1]) * matrix.itemsize
        width = max(1, min(count, max(NARROW, PANEL_BYTES // line)))

        def work(panels: range) -> None:
            for columns in _slices(panels, width, count):
                frequencies = slice(first + columns.start, first + columns.stop)
                self._panel(matrix[..., columns], frequencies)

        share(work, -(-count // width), matrix.size)

    def rows_out(self, Z: Array, y: Array) -> None:
        """Transform what `rows_in` has returned back, into lines of shape (rows, n)."""
        n, L, w = self._grid[-1], self.lengths[-1], self._phases
        height = max(1, BLOCK_BYTES // (L * Z.itemsize))

        def work(blocks: range) -> None:
            for rows in _slices(blocks, height, len(y)):
                R = Z[rows]
                _in_place(fft.ifft, R, 1)
                R = R[:, :n]
                if w is None:
                    y[rows] = R
                else:
                    R *= w.conj()
                    y[rows] = R.real

        share(work, -(-len(y) // height), Z.size)

    @property
    def precision(self) -> np.dtype[Any]:
        """The complex dtype of the frequencies."""
        return np.dtype(self.dtype.char.upper())

    @property
    def _phases(self) -> Array | None:
        """The factors that shift the frequencies by 1/4; None of a complex matrix."""
        if self._is_complex:
            return None
        return phase_factors(self.lengths[-1], 0.25, self.precision)[: self._grid[-1]]

    def _panel(self, part: Array, columns: slice) -> None:
        """Multiply some frequencies of the last axis, in place."""
        grid = self._grid[:-1]
        P = workspace((*part.shape[:2], *self.lengths[:-1], part.shape[-1]), part.dtype)
        # Number k has the lines along axis k, where the axes before are not extended, or cut again.
        lines = [P[(slice(None), slice(None), *map(slice, grid[:k]))] for k in range(len(grid) + 1)]
        lines[-1][...] = part
        for k in reversed(range(len(grid))):
            lines[k][(slice(None),) * (2 + k) + (slice(grid[k], None),)] = 0.0
            _in_place(fft.fft, lines[k], 2 + k)
        self._times_spectrum(P, columns)
        for k in range(len(grid)):
            _in_place(fft.ifft, lines[k], 2 + k)
        part[...] = lines[-1]

    def _times_spectrum(self, P: Array, columns: slice) -> None:
        assert self.spectrum is not None
        if self._components == 1:
            spectrum = self.spectrum[0][0]
            P[:, 0] *= 0.0 if spectrum is None else spectrum[..., columns]
            return
        Q = workspace(P.shape, P.dtype)
        part = workspace(P[:, 0].shape, P.dtype)
        for i, row in enumerate(self.spectrum):
            terms = [(j, s) for j, s in enumerate(row) if s is not None]
            if not terms:
                Q[:, i] = 0.0
            for k, (j, spectrum) in enumerate(terms):
                np.multiply(P[:, j], spectrum[..., columns], out=part if k else Q[:, i])
                if k:
                    Q[:, i] += part
        P[...] = Q


def _spectrum(lags: Array | None, is_complex: bool) -> Array | None:
    """Return the eigenvalues of a block's embedding, over the lengths of the inverse transforms."""
    if lags is None or not lags.any():
        return None
    grid = [(m + 1) // 2 for m in lags.shape]
    lengths = embedding_lengths(grid, is_complex=is_complex)
    count_transforms(1, *(2 * n for n in grid))
    column = np.zeros(lengths, np.complex128)
    around = column if is_complex else column.imag
    # Along each axis the lags from 0 on are in front, and then those below 0 behind. Of a real
    # matrix both may be in the same places of the last axis, as real and imaginary parts.
    halves = [
        [(slice(n), slice(n - 1, None)), (slice(1 - n, None), slice(n - 1))][: min(n, 2)]
        for n in grid
    ]
    for parts in combinations(*halves):
        to, of = zip(*parts, strict=True)
        is_behind = of[-1].stop is not None
        (around if is_behind else column)[to] = lags[of]
    if is_complex:
        column /= prod(lengths)
    else:
        column *= phase_factors(lengths[-1], 0.25, np.dtype(np.complex128)) / prod(lengths)
    spectrum = fft.fftn(column, overwrite_x=True)
    return spectrum.real if np.array_equal(lags, np.flip(lags).conj()) else spectrum


def _cast(spectrum: Array | None, dtype: DTypeLike) -> Array | None:
    """Bring eigenvalues to this precision."""
    return None if spectrum is None else np.ascontiguousarray(cast_numbers(spectrum, dtype))


def _transpose(blocks: Kernel, of_block: Callable[[Array], Array]) -> Kernel:
    return [
        [None if block is None else of_block(block) for block in column]
        for column in zip(*blocks, strict=True)
    ]


def entries(lags: Array, rows: Sequence[Array] | Array, columns: Sequence[Array] | Array) -> Array:
    """Return the a[i - j] of all pairs of points, which are given by their index on each axis."""
    lag = (
        np.subtract.outer(i, j) + m // 2 for i, j, m in zip(rows, columns, lags.shape, strict=True)
    )
    return lags[tuple(lag)]


def _slices(blocks: range, size: int, end: int) -> Iterator[slice]:
    for block in blocks:
        yield slice(block * size, min(end, (block + 1) * size))


def _in_place(transform: Any, A: Array, axis: int) -> None:
    """Transform along an axis, without any factor, in the memory of `A`."""
    norm = "forward" if transform is fft.ifft else "backward"
    B = transform(A, axis=axis, norm=norm, overwrite_x=True)
    if not np.may_share_memory(A, B):
        A[...] = B
