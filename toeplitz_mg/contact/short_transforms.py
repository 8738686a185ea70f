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
from toeplitz_mg.contact.steady_matrices import fade_rate
from toeplitz_mg.engine.products import multiply_rows
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.operators import CoupledOperator

# Additions whose inverses are interpolated, over the diagonal: of two, and not three, it takes
# hardly more iterations, each of which takes less time.
ADDITIONS = np.array([0.0, 3.0])
KEPT = 8  # Lengths whose matrices are kept: a grid has two, for several operators.


class ShortTransforms:
    """Transforms of real fields on a grid of two axes, padded so that no lag meets another.

    Parameters
    ----------
    shape : (int, int)
        Of the grid.
    dtype : float32 or float64
    fade : ndarray of shape (n,)
        What fields are divided by along the first axis before they are transformed, and multiplied
        with after they are transformed back.

    Attributes
    ----------
    lengths : (int, int)
        Of the padded grid: 2 n - 1, which is odd.
    """

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike, fade: Any = 1.0) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self.lengths = 2 * shape[0] - 1, 2 * shape[1] - 1
        rows, columns = (_roots(length) for length in self.lengths)
        n, m = shape  # Of the frequencies along the second axis the first m are all others' too.
        complex_ = np.result_type(self.dtype, np.complex64)
        columns = columns[:m, :m]
        self._along_columns = columns.astype(complex_).view(self.dtype)
        fades = np.broadcast_to(fade, n)
        self._along_rows = np.ascontiguousarray(rows[:, :n] / fades, complex_)
        back = rows[:n].conj() * (fades[:, None] / self.lengths[0])
        self._back_along_rows = back.astype(complex_)
        weights = np.where(np.arange(m) > 0, 2.0, 1.0) / self.lengths[1]
        back = columns.T * weights[:, None]
        back = np.stack([back.real, back.imag], axis=1).reshape(2 * m, m)
        self._back_along_columns = back.astype(self.dtype)

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, (k, n, m), at all frequencies along the first axis."""
        n, m = self.shape
        along_columns = (x.reshape(-1, m) @ self._along_columns).view(self._along_rows.dtype)
        return self._along_rows @ along_columns.reshape(-1, n, m)

    def back(self, X: Array) -> Array:
        """Return the fields, of the shape of the grid, that have these transforms."""
        n, m = self.shape
        along_columns = (self._back_along_rows @ X).view(self.dtype)
        return (along_columns.reshape(-1, 2 * m) @ self._back_along_columns).reshape(-1, n, m)


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
        transforms = ShortTransforms(K.grid_shape[1:], np.float64)
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
        return ShortProduct(self._spectra, ShortTransforms(self._transforms.shape, dtype))

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
    """Sums of circulants, as `steady_matrices.Circulants` has them, of a small grid."""

    additions = ADDITIONS

    def __init__(self, grid: tuple[int, ...], dtype: DTypeLike) -> None:
        fade = np.exp(fade_rate(2 * grid[0] - 1) * np.arange(grid[0]))
        self._transforms = ShortTransforms(grid, dtype, fade)
        self.lengths = self._transforms.lengths
        self._points = points_of_transform(*self.lengths)

    def prepare(self, weights: Array) -> Array:
        """Return weights as `add` takes them: what they fade is in the transforms."""
        return weights

    def add(self, r: Array, weights: Array, eigenvalues: Array) -> Array:
        """Return the sum of the circulants of a field, each with its weights."""
        count_work(1, (1 + len(eigenvalues)) * len(r) * self._points)
        R = self._transforms.forward(r)
        Z = (eigenvalues * R).reshape(-1, *R.shape[1:])
        y = self._transforms.back(Z).reshape(len(eigenvalues), *r.shape)
        return np.einsum("krn,kcrn->crn", weights, y)


@lru_cache(maxsize=KEPT)
def _roots(length: int) -> Array:
    """Return the matrix of a discrete Fourier transform."""
    k = np.arange(length)
    roots = np.exp(-2j * np.pi / length * (np.outer(k, k) % length))
    roots.flags.writeable = False
    return roots
