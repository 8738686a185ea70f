"""The FFT engine behind every product, and the meter that counts its work."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from itertools import count
from math import prod
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import fft

Array = NDArray[Any]


class ProductCount:
    """Work done by the products of a block of code, in grid points.

    Attributes
    ----------
    points : float
        A product with a Toeplitz matrix counts the unknowns of its grid. A circulant, whose
        transforms are not padded, counts 1/2^d of them (d levels).
    products : int
        The number of products, of any size.
    """

    def __init__(self) -> None:
        self.points = 0.0
        self.products = 0

    def units(self, n: int) -> float:
        """Return the work units: the work in products on a grid of `n` points (paper, §5.2)."""
        return self.points / n


_active_counts: ContextVar[tuple[ProductCount, ...]] = ContextVar("_active_counts", default=())


@contextmanager
def count_products() -> Iterator[ProductCount]:
    """Count the products made inside a ``with`` block, by every operator of this package.

    Yields
    ------
    ProductCount
        It goes on counting until the block ends; blocks may be nested. Products of other
        threads are not counted.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([2.0, -1.0, 0.0, 0.0])
    >>> with tmg.count_products() as work:
    ...     y = A @ np.ones(4)
    ...     z = A @ y
    >>> work.units(4)
    2.0
    """
    product_count = ProductCount()
    token = _active_counts.set((*_active_counts.get(), product_count))
    try:
        yield product_count
    finally:
        _active_counts.reset(token)


def _count(products: int, points: float) -> None:
    for active in _active_counts.get():
        active.points += products * points
        active.products += products


def count_transforms(number: float, *shape: int) -> None:
    """Count real transforms that are no product: those of a product are two of 2 n in a level."""
    _count(1, number * prod(shape) / 2 ** (len(shape) + 1))


def near_fast_length(n: int) -> int:
    """Return the next length whose transform is not slow, but not always among the fastest.

    No prime factor is above 61. The next length without one above 5 may be some percent longer.
    """
    return next(m for m in count(n) if _is_fast(m))


def _is_fast(m: int) -> bool:
    for p in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61):
        while m % p == 0:
            m //= p
    return m == 1


class Transforms(NamedTuple):
    """A transform that diagonalises an algebra of matrices, and its inverse."""

    forward: Callable[..., Array]
    backward: Callable[..., Array]


FOURIER = Transforms(fft.rfftn, fft.irfftn)  # circulants
COSINE = Transforms(partial(fft.dctn, norm="ortho"), partial(fft.idctn, norm="ortho"))  # DCT-II
SINE = Transforms(partial(fft.dstn, norm="ortho"), partial(fft.idstn, norm="ortho"))  # DST-II


class Convolution:
    """Multiplication by a matrix that a fast transform diagonalises, such as a circulant.

    The vectors live on a grid, are extended by zeros to the size of the matrix, and cut again.

    Parameters
    ----------
    spectrum : ndarray
        The eigenvalues; of a circulant the ``rfftn`` of its first column, real where it is
        symmetric.
    fft_shape : tuple of int
        The size of the matrix in each level.
    grid_shape : tuple of int
        The size of the vectors, at most `fft_shape` in each level.
    dtype : float32 or float64
    transforms : Transforms
    """

    def __init__(
        self,
        spectrum: Array,
        fft_shape: tuple[int, ...],
        grid_shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
        transforms: Transforms = FOURIER,
    ) -> None:
        self.transforms = transforms
        self.dtype = np.dtype(dtype)
        # float32 -> complex64 or float32: the spectrum in the precision of the products.
        precision = np.result_type(self.dtype, np.complex64)
        if not np.iscomplexobj(spectrum):
            precision = self.dtype
        self.spectrum = spectrum.astype(precision, copy=False)
        self.fft_shape = fft_shape
        self.grid_shape = grid_shape
        self._axes = tuple(range(-len(grid_shape), 0))
        self._cut: Any = (..., *(slice(n) for n in grid_shape))
        # The share of a product on this grid, whose transforms are twice as long in each level.
        embedded = transforms is FOURIER and fft_shape != grid_shape
        self._points = prod(grid_shape) / (1 if embedded else 2 ** len(grid_shape))

    @classmethod
    def from_first_column(
        cls,
        column: Array,
        grid_shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
        *,
        symmetric: bool,
    ) -> Self:
        """Build the convolution whose circulant has the first column `column`."""
        count_transforms(1, *column.shape)
        spectrum = fft.rfftn(column)
        return cls(spectrum.real if symmetric else spectrum, column.shape, grid_shape, dtype)

    def adjoint(self) -> Self:
        """Return the multiplication by the transpose; no transform is made."""
        conjugate = self.spectrum.conj()
        return type(self)(conjugate, self.fft_shape, self.grid_shape, self.dtype, self.transforms)

    def __call__(self, X: Array) -> Array:
        """Multiply the rows of `X`, shape (..., N), N the number of grid points."""
        if np.iscomplexobj(X):
            return np.asarray(self(X.real) + 1j * self(X.imag))
        rows = X.shape[:-1]
        _count(prod(rows), self._points)
        dtype = np.result_type(X.dtype, self.dtype)
        grid = X.reshape(rows + self.grid_shape).astype(dtype, copy=False)
        forward, backward = self.transforms
        hat = forward(grid, s=self.fft_shape, axes=self._axes)
        hat *= self.spectrum
        Y = backward(hat, s=self.fft_shape, axes=self._axes, overwrite_x=True)[self._cut]
        return np.asarray(Y).reshape(X.shape)


class CirculantTimesSkew:
    """Multiplication by C Sᵀ, C the circulant and S the skew-circulant with one first column.

    Both are of the size n of the column; the vectors are complex. Four transforms of length n, as
    much work as two products with a Toeplitz matrix of that size.

    Parameters
    ----------
    column : ndarray of shape (n,), real
    dtype : float32 or float64
    """

    def __init__(self, column: Array, dtype: DTypeLike = np.float64) -> None:
        precision = np.result_type(dtype, np.complex64)
        n = len(column)
        # A skew-circulant is a circulant between multiplications by w = exp(iπk/n).
        w = np.exp(1j * np.pi / n * np.arange(n))
        self._w = w.astype(precision)
        self._circulant = fft.fft(column).astype(precision)
        self._skew = fft.fft(column * w).conj().astype(precision)

    def __call__(self, Z: Array) -> Array:
        """Multiply the rows of `Z`, shape (..., n), complex."""
        _count(prod(Z.shape[:-1]), 2.0 * Z.shape[-1])
        Y = fft.fft(Z * self._w)
        Y *= self._skew
        Y = fft.ifft(Y, overwrite_x=True)
        Y *= self._w.conj()
        Y = fft.fft(Y, overwrite_x=True)
        Y *= self._circulant
        return np.asarray(fft.ifft(Y, overwrite_x=True))
