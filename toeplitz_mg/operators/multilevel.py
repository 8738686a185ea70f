"""Products with Toeplitz matrices of several levels, whose entries may be small matrices.

Each row of the last level is transformed as in `convolution.ToeplitzProduct`, at the frequencies
k + 1/4, without an extension by zeros. What is left for each frequency is a Toeplitz matrix of the
other levels. These are extended by zeros; the transforms skip the lines that are zero on the way
in, and those that are cut off on the way out. They work on a panel of some frequencies of the last
level that stays in the cache.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import fft
from scipy.linalg import norm

from toeplitz_mg.operators.convolution import DENSE, multiply_rows
from toeplitz_mg.operators.threads import share
from toeplitz_mg.operators.transforms import BATCH, phase_factors
from toeplitz_mg.operators.work import count_transforms
from toeplitz_mg.operators.workspace import workspace

Array = NDArray[Any]
Kernel = Sequence[Sequence[Array | None]]  # lags of each pair of components; None is zero

PANEL_BYTES = 2**20
BLOCK_BYTES = 2**18  # of rows
NARROW = 8  # columns of a panel at least: shorter pieces of a row take as long


class MultilevelProduct:
    """Multiplication by a real Toeplitz matrix of several levels, or by blocks of such.

    Parameters
    ----------
    kernel : sequence of sequences of ndarray or None
        For each pair of components (i, j) the lags, shape (2 n₁ - 1, ..., 2 n_d - 1), that take
        component j of the vector to component i of the result. The vectors have the components
        one after the other.
    dtype : float32 or float64
    known : the same of the eigenvalues, optional
        That other products have for these lags. None has to be computed.
    """

    def __init__(self, kernel: Kernel, dtype: DTypeLike, known: Kernel | None = None) -> None:
        first = next(lags for row in kernel for lags in row if lags is not None)
        self._grid = tuple((m + 1) // 2 for m in first.shape)
        self._components = len(kernel)
        self.grid_shape = (self._components, *self._grid)
        self.dtype, self.points = np.dtype(dtype), float(prod(self.grid_shape))
        self._kernel = kernel
        if prod(self.grid_shape) > DENSE:
            known = known or [[None] * len(row) for row in kernel]
            self.symbol = [
                [self._symbol(a) if s is None else self._cast(s) for a, s in zip(*row, strict=True)]
                for row in zip(kernel, known, strict=True)
            ]
            self._kernel = []  # of no more use

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """The lengths of the transforms in each level."""
        *others, last = self._grid
        return (*(fft.next_fast_len(2 * n - 1) for n in others), fft.next_fast_len(last))

    def adjoint(self) -> "MultilevelProduct":
        """Return the multiplication by the transpose; no transform is made."""
        adjoint = MultilevelProduct.__new__(MultilevelProduct)
        adjoint._grid, adjoint._components = self._grid, self._components
        adjoint.grid_shape, adjoint.dtype, adjoint.points = self.grid_shape, self.dtype, self.points
        adjoint._kernel = [
            [None if lags is None else np.flip(lags) for lags in column]
            for column in zip(*self._kernel, strict=True)
        ]
        if prod(self.grid_shape) > DENSE:
            adjoint.symbol = [
                [None if s is None else s.conj() for s in column]
                for column in zip(*self.symbol, strict=True)
            ]
        return adjoint

    def astype(self, dtype: DTypeLike) -> "MultilevelProduct":
        """Return the multiplication in another precision; no transform is made."""
        other = MultilevelProduct.__new__(MultilevelProduct)
        other._grid, other._components = self._grid, self._components
        other.grid_shape, other.dtype, other.points = self.grid_shape, np.dtype(dtype), self.points
        other._kernel = self._kernel
        if prod(self.grid_shape) > DENSE:
            other.symbol = [
                [None if s is None else other._cast(s) for s in row] for row in self.symbol
            ]
        return other

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: of the symbol, by its rows."""
        symbol = (
            self.symbol
            if prod(self.grid_shape) > DENSE
            else [[self._symbol(lags) for lags in row] for row in self._kernel]
        )
        sizes = [[0.0 if s is None else float(np.abs(s).max()) for s in row] for row in symbol]
        return float(norm(np.ravel(sizes))) * prod(self.lengths)  # by nrm2: of any size

    def _symbol(self, lags: Array | None) -> Array | None:
        """The eigenvalues of a block, divided by the lengths of the inverse transforms."""
        if lags is None or not lags.any():
            return None
        count_transforms(1, *(2 * n for n in self._grid))
        column = np.zeros(self.lengths, np.complex128)
        n = self._grid[-1]
        inside = tuple(slice(m) for m in lags.shape[:-1])
        column[(*inside, slice(n))] = lags[..., n - 1 :]
        if n > 1:
            column.imag[(*inside, slice(1 - n, None))] = lags[..., : n - 1]
        levels = tuple(range(lags.ndim - 1))
        column = np.roll(column, [1 - m for m in self._grid[:-1]], levels)
        w = phase_factors(self.lengths[-1], 0.25, np.dtype(np.complex128))
        column *= w / prod(self.lengths)
        symbol = fft.fftn(column, overwrite_x=True)
        if np.array_equal(lags, np.flip(lags)):
            symbol = symbol.real
        return self._cast(symbol)

    def _cast(self, symbol: Array) -> Array:
        precision = self.dtype.char.upper() if np.iscomplexobj(symbol) else self.dtype
        return np.ascontiguousarray(symbol, precision)

    @cached_property
    def _matrix(self) -> Array:
        """The transpose of the matrix."""
        points = np.indices(self._grid).reshape(len(self._grid), -1)
        zero = np.zeros((points.shape[1],) * 2)
        blocks = [
            [zero if lags is None else entries(lags, points, points) for lags in row]
            for row in self._kernel
        ]
        return np.ascontiguousarray(np.block(blocks).T, self.dtype)

    def __call__(self, X: Array, out: Array | None = None) -> Array:
        """As `multiply_rows`."""
        return multiply_rows(self, X, out)

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, real, of shape (rows, N), into `out`, which may be `X`."""
        if X.shape[1] <= DENSE:
            out[...] = X.astype(self.dtype, copy=False) @ self._matrix
            return
        batch = max(1, BATCH // prod(self.lengths))
        for start in range(0, len(X), batch):
            self._multiply(X[start : start + batch], out[start : start + batch])

    def _multiply(self, X: Array, out: Array) -> None:
        n, L = self._grid[-1], self.lengths[-1]
        precision = np.dtype(self.dtype.char.upper())
        w = phase_factors(L, 0.25, precision)[:n]
        x, y = X.reshape(-1, n), out.reshape(-1, n)
        Z = workspace((len(x), L), precision)
        shape = (len(X), self._components, *self._grid[:-1])
        matrix = Z.reshape(*shape, L)
        height = max(1, BLOCK_BYTES // (L * precision.itemsize))

        def rows_in(blocks: range) -> None:
            for rows in _slices(blocks, height, len(x)):
                R = Z[rows]
                np.multiply(x[rows], w, out=R[:, :n], casting="same_kind")
                R[:, n:] = 0.0
                _in_place(fft.fft, R, 1)

        def columns_through(panels: range) -> None:
            for columns in _slices(panels, width, L):
                self._panel(matrix[..., columns], columns)

        def rows_out(blocks: range) -> None:
            for rows in _slices(blocks, height, len(x)):
                R = Z[rows]
                _in_place(fft.ifft, R, 1)
                R = R[:, :n]
                R *= w.conj()
                y[rows] = R.real

        line = len(X) * self._components * prod(self.lengths[:-1]) * precision.itemsize
        width = min(L, max(NARROW, PANEL_BYTES // line))
        share(rows_in, -(-len(x) // height), Z.size)
        share(columns_through, -(-L // width), Z.size)
        share(rows_out, -(-len(x) // height), Z.size)

    def _panel(self, part: Array, columns: slice) -> None:
        """Multiply some frequencies of the last level, in place."""
        grid = self._grid[:-1]
        P = workspace((*part.shape[:2], *self.lengths[:-1], part.shape[-1]), part.dtype)
        # Lines of level k, where the levels before it are not extended yet, or cut again.
        lines = [P[(slice(None), slice(None), *map(slice, grid[:k]))] for k in range(len(grid) + 1)]
        lines[-1][...] = part
        for k in reversed(range(len(grid))):
            lines[k][(slice(None),) * (2 + k) + (slice(grid[k], None),)] = 0.0
            _in_place(fft.fft, lines[k], 2 + k)
        self._times_symbol(P, columns)
        for k in range(len(grid)):
            _in_place(fft.ifft, lines[k], 2 + k)
        part[...] = lines[-1]

    def _times_symbol(self, P: Array, columns: slice) -> None:
        if self._components == 1:
            symbol = self.symbol[0][0]
            P[:, 0] *= 0.0 if symbol is None else symbol[..., columns]
            return
        Q = workspace(P.shape, P.dtype)
        part = workspace(P[:, 0].shape, P.dtype)
        for i, row in enumerate(self.symbol):
            terms = [(j, s) for j, s in enumerate(row) if s is not None]
            if not terms:
                Q[:, i] = 0.0
            for k, (j, symbol) in enumerate(terms):
                np.multiply(P[:, j], symbol[..., columns], out=part if k else Q[:, i])
                if k:
                    Q[:, i] += part
        P[...] = Q


def entries(lags: Array, rows: Sequence[Array] | Array, columns: Sequence[Array] | Array) -> Array:
    """Return the a[i - j] of all pairs of points, which are given by their index in each level."""
    lag = (
        np.subtract.outer(i, j) + m // 2 for i, j, m in zip(rows, columns, lags.shape, strict=True)
    )
    return np.asarray(lags[tuple(lag)])


def _slices(blocks: range, size: int, end: int) -> Iterator[slice]:
    for block in blocks:
        yield slice(block * size, min(end, (block + 1) * size))


def _in_place(transform: Any, A: Array, axis: int) -> None:
    """Transform along an axis, without any factor, in the memory of `A`."""
    norm = "forward" if transform is fft.ifft else "backward"
    B = transform(A, axis=axis, norm=norm, overwrite_x=True)
    if not np.may_share_memory(A, B):
        A[...] = B
