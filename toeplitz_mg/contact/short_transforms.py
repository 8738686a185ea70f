"""Discrete Fourier transforms of small grids, by matrices, and what is made of them.

Of a few dozen elements along an axis a transform is a product with a matrix, one call of BLAS for
each axis and all components, in about half the time of fast ones. The matrices stay in the cache,
where a dense matrix of all unknowns would not.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.circulants import Sums, fade_rate, find_lengths
from toeplitz_mg.engine.products import multiply_rows
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.operators import CoupledOperator

# Additions whose inverses are interpolated, over the diagonal: of two, and not three, it takes
# hardly more iterations, each of which takes less time.
SHORT_ADDITIONS = np.array([0.0, 3.0])
MOST = 2**15  # Multiplications of complex numbers in a product up to which BLAS takes one thread.
KEPT = 8  # Lengths whose matrices are kept: a grid has two, for several operators.


class ShortTransforms:
    """Transforms of real fields on a grid of two axes, padded with zeros.

    Parameters
    ----------
    shape : (int, int)
        Of the grid.
    dtype : float32 or float64
    lengths : (int, int)
        Of the padded grid, odd.
    fade : ndarray of shape (n,)
        What fields are divided by along the first axis before they are transformed, and multiplied
        with after they are transformed back.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: DTypeLike, lengths: tuple[int, ...], fade: Any = 1.0
    ) -> None:
        self.shape, self.dtype, self.lengths = shape, np.dtype(dtype), lengths
        rows, columns = (_roots(length) for length in lengths)
        # Of the frequencies along the second axis half are all others' too.
        (n, m), half = shape, (lengths[1] + 1) // 2
        complex_ = np.result_type(self.dtype, np.complex64)
        columns = columns[:m, :half]
        self._along_columns = columns.astype(complex_).view(self.dtype)
        fades = np.broadcast_to(fade, n)
        self._along_rows = np.ascontiguousarray(rows[:, :n] / fades, complex_)
        back = rows[:n].conj() * (fades[:, None] / self.lengths[0])
        self._back_along_rows = back.astype(complex_)
        weights = np.where(np.arange(half) > 0, 2.0, 1.0) / self.lengths[1]
        back = columns.T * weights[:, None]
        back = np.stack([back.real, back.imag], axis=1).reshape(2 * half, m)
        self._back_along_columns = back.astype(self.dtype)

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, (k, n, m), at all frequencies along the first axis."""
        along_columns = x.reshape(-1, *self.shape) @ self._along_columns
        return _multiply(self._along_rows, along_columns.view(self._along_rows.dtype))

    def back(self, X: Array) -> Array:
        """Return the fields, of the shape of the grid, that have these transforms."""
        return _multiply(self._back_along_rows, X).view(self.dtype) @ self._back_along_columns


class ShortProduct:
    """Multiplication by Toeplitz matrices between components, on a small grid.

    Parameters
    ----------
    spectra : ndarray of shape (components, components, frequencies, frequencies)
        The transforms of their lags.
    transforms : ShortTransforms
    """

    def __init__(self, spectra: Array, transforms: ShortTransforms) -> None:
        self.dtype, self._transforms = transforms.dtype, transforms
        self._spectra = spectra.astype(np.result_type(self.dtype, np.complex64))
        self.points = float(len(spectra) * np.prod(transforms.shape))

    @classmethod
    def of(cls, K: CoupledOperator) -> "ShortProduct":
        """Return the products of an operator of two axes."""
        n, m = K.grid_shape[1:]
        transforms = ShortTransforms((n, m), np.float64, (2 * n - 1, 2 * m - 1))
        zero = np.zeros((1, 1))
        circulants = [
            [zero if a is None else a.circulant(transforms.lengths) for a in row]
            for row in K.blocks
        ]
        spectra = [[np.fft.rfft2(c, transforms.lengths) for c in row] for row in circulants]
        return cls(np.array(spectra), transforms)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: the largest size of the matrices between the components."""
        return float(np.linalg.norm(self._spectra, axis=(0, 1)).max())

    def astype(self, dtype: DTypeLike) -> "ShortProduct":
        """Return the same products in another precision."""
        transforms = ShortTransforms(self._transforms.shape, dtype, self._transforms.lengths)
        return ShortProduct(self._spectra, transforms)

    def adjoint(self) -> "ShortProduct":
        """Return the products with the adjoint."""
        return ShortProduct(self._spectra.conj().swapaxes(0, 1), self._transforms)

    __call__ = multiply_rows

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X` into `out`."""
        components, *frequencies = self._spectra.shape[1:]
        fields = X.astype(self.dtype, copy=False).reshape(-1, *self._transforms.shape)
        Z = self._transforms.forward(fields).reshape(-1, 1, components, *frequencies)
        total = self._spectra[:, 0] * Z[..., 0, :, :]
        for k in range(1, components):
            total += self._spectra[:, k] * Z[..., k, :, :]
        out[...] = self._transforms.back(total.reshape(-1, *frequencies)).reshape(out.shape)


class ShortCirculants:
    """Products with circulants, as `circulants.Circulants` has them, of a small grid."""

    def __init__(self, grid: tuple[int, ...], dtype: DTypeLike) -> None:
        self.dtype = np.dtype(dtype)
        self.lengths = tuple(length | 1 for length in find_lengths(grid))
        fade = np.exp(fade_rate(self.lengths[0]) * np.arange(grid[0]))
        self._transforms = ShortTransforms(grid, dtype, self.lengths, fade)
        self._points = points_of_transform(*self.lengths)

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, (..., components, ...)."""
        X = self._transforms.forward(x)
        count_work(1, len(X) * self._points)
        return X.reshape(*x.shape[:-2], *X.shape[1:])

    def multiply(self, sums: Sums) -> Array:
        """Return the fields, (k, components, ...), that are sums of circulants times transforms."""
        totals = np.empty((len(sums), *sums[0][0][0].shape), sums[0][0][0].dtype)
        for total, ((X, eigenvalues), *others) in zip(totals, sums, strict=True):
            np.multiply(X, eigenvalues, out=total)
            for X, eigenvalues in others:
                total += X * eigenvalues
        components, *frequencies = totals.shape[1:]
        count_work(1, len(totals) * components * self._points)
        fields = self._transforms.back(totals.reshape(-1, *frequencies))
        return fields.reshape(-1, components, *self._transforms.shape)


def _multiply(A: Array, X: Array) -> Array:
    """Return the products of a complex matrix with each of some, without the threads of BLAS.

    For so few numbers they save little time, and then wait for more to do, on cores of others.
    """
    size = max(1, MOST // X[0].size)
    if len(A) <= size:
        result: Array = A @ X
        return result
    product = np.empty((len(X), len(A), X.shape[2]), X.dtype)
    for k in range(0, len(A), size):
        np.matmul(A[k : k + size], X, out=product[:, k : k + size])
    return product


@lru_cache(maxsize=KEPT)
def _roots(length: int) -> Array:
    """Return the matrix of a discrete Fourier transform."""
    k = np.arange(length)
    roots = np.exp(-2j * np.pi / length * (np.outer(k, k) % length))
    roots.flags.writeable = False
    return roots
