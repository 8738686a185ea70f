"""The FFT engine behind every product, and the meter that counts its work."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import prod
from typing import Any, Self

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
    count = ProductCount()
    token = _active_counts.set((*_active_counts.get(), count))
    try:
        yield count
    finally:
        _active_counts.reset(token)


class Convolution:
    """Multiplication by a circulant, of vectors on a grid that is extended by zeros to its size.

    Parameters
    ----------
    spectrum : ndarray
        The ``rfftn`` of the circulant's first column. Real where the circulant is symmetric.
    fft_shape : tuple of int
        The circulant's size in each level.
    grid_shape : tuple of int
        The size of the vectors, at most `fft_shape` in each level; the result is cut to it.
    dtype : float32 or float64
    """

    def __init__(
        self,
        spectrum: Array,
        fft_shape: tuple[int, ...],
        grid_shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
    ) -> None:
        self.dtype = np.dtype(dtype)
        # float32 -> complex64 or float32: the spectrum in the precision of the products.
        precision = np.result_type(self.dtype, np.complex64)
        if not np.iscomplexobj(spectrum):
            precision = self.dtype
        self.spectrum = spectrum.astype(precision, copy=False)
        self.fft_shape = fft_shape
        self.grid_shape = grid_shape
        self._axes = tuple(range(-len(grid_shape), 0))
        self._cut = (..., *(slice(n) for n in grid_shape))
        # The share of a product on this grid: a circulant transforms no padding.
        self._points = prod(grid_shape) / (1 if fft_shape != grid_shape else 2 ** len(grid_shape))

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
        spectrum = fft.rfftn(column)
        return cls(spectrum.real if symmetric else spectrum, column.shape, grid_shape, dtype)

    def adjoint(self) -> Self:
        """Return the multiplication by the transpose; no transform is made."""
        return type(self)(self.spectrum.conj(), self.fft_shape, self.grid_shape, self.dtype)

    def __call__(self, X: Array) -> Array:
        """Multiply the rows of `X`, shape (..., N), N the number of grid points."""
        if np.iscomplexobj(X):
            return np.asarray(self(X.real) + 1j * self(X.imag))
        rows = X.shape[:-1]
        for count in _active_counts.get():
            count.points += prod(rows) * self._points
            count.products += prod(rows)
        dtype = np.result_type(X.dtype, self.dtype)
        grid = X.reshape(rows + self.grid_shape).astype(dtype, copy=False)
        hat = fft.rfftn(grid, self.fft_shape, axes=self._axes)
        hat *= self.spectrum
        Y = fft.irfftn(hat, self.fft_shape, axes=self._axes, overwrite_x=True)[self._cut]
        return np.asarray(Y).reshape(X.shape)
