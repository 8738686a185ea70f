"""Multiplication by matrices that a fast transform diagonalises, directly or after embedding."""

from collections.abc import Callable
from functools import cached_property, partial
from math import prod
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import toeplitz
from scipy.linalg.blas import idamax, izamax

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.fourstep import FourStep
from toeplitz_mg.engine.threads import share_rows
from toeplitz_mg.engine.transforms import LONG, OneStep, in_batches, plan_of
from toeplitz_mg.engine.vectors import power_above
from toeplitz_mg.engine.work import axes_of, count_transforms, count_work
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.values import refuse_masked

NEAR_ONE = 1e-9, 1e9  # Peak values between which single precision needs no scaling of a vector.
SHIFTS = {"f": (0.25,), "c": (0.0, 0.5)}  # Shifts of the frequencies in `ToeplitzProduct`.
DENSE = 256  # Most unknowns for which the dense matrix is faster than transforms.


class Product(Protocol):
    """The interface of all products: multiplication of rows by a matrix."""

    dtype: np.dtype[Any]  # Dtype of the products, whatever the dtype of the vectors is.
    points: float  # Work of a product, in grid points.

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out`, which may be `X`.

        If the matrix is real, the rows are real; if it is complex, they may be real or complex.
        """


def multiply_rows(product: Product, X: Array, out: Array | None = None) -> Array:
    """Return the products with the rows of `X`, shape (..., N), in `out` or in a new array.

    This is the ``__call__`` of every product. The dtype of a new array is the one that NumPy gives
    to the product of a matrix and a vector of these dtypes. `out` has the shape of `X` and may be
    `X`. A real matrix multiplies the real and the imaginary part of complex vectors.
    """
    if product.dtype.kind == "c":
        if out is not None and out.dtype.kind != "c":
            raise TypeError(f"out has dtype {out.dtype}, but the product is complex")
    elif X.dtype.kind == "c":
        out = np.empty(X.shape, np.result_type(X, product.dtype)) if out is None else out
        out.real, out.imag = multiply_rows(product, np.stack([X.real, X.imag]))
        return out
    if out is None:
        out = np.empty(X.shape, np.result_type(X, product.dtype))
    if not X.size:  # There may be no rows.
        return out
    n = X.shape[-1]
    rows = X.reshape(-1, n)
    count_work(len(rows), product.points)
    if product.dtype.char in "fF" and rows.dtype.char in "dD":
        _multiply_in_range(product, rows, out.reshape(-1, n))
    else:
        product.multiply(rows, out.reshape(-1, n))
    return out


def _multiply_in_range(product: Product, rows: Array, out: Array) -> None:
    """Multiply rows in double precision by a matrix in single precision, whose range is smaller.

    Rows whose peak is far from 1 are scaled by powers of two, which is exact.
    """
    low, high = NEAR_ONE
    find = izamax if rows.dtype.char == "D" else idamax  # One call for each row.
    if all(low < abs(row[find(row)]) < high for row in rows):
        product.multiply(rows, out)
        return
    peaks = np.abs(rows).max(axis=1, keepdims=True)
    powers = np.where(np.isfinite(peaks), power_above(peaks), 0)
    product.multiply(rows * np.ldexp(1.0, -powers), out)
    for part in (out.real, out.imag) if out.dtype.kind == "c" else (out,):
        part *= np.ldexp(1.0, powers)


class ToeplitzProduct:
    """Multiplication by a Toeplitz matrix with one axis.

    Up to `DENSE` unknowns the dense matrix is used. A larger real matrix with coefficients a is
    embedded in a matrix of size L ≥ n, in which entries that wrap around are multiplied by i:

        Re of the matrix with the first column a_k + i a_(k-L)    (k = 0 … L - 1)

    has the Toeplitz matrix as its leading block, as the entries that wrap around are imaginary. The
    transform at the frequencies k + 1/4 diagonalises it. A product takes one complex transform of
    length L each way instead of zero-padded real ones of length 2 L. If the matrix is symmetric,
    the eigenvalues Σ a_k cos kθ are real.

    A complex matrix is embedded in the mean of a circulant and a skew-circulant of size L, whose
    first columns are a_k ± a_(k-L). Transforms at the frequencies k and k + 1/2 diagonalise them.

    References
    ----------
    R. Crandall, B. Fagin, Discrete weighted transforms and large-integer arithmetic, Math. Comp.
    62 (1994): "right-angle convolution".
    """

    grid_shape: tuple[int, ...]

    def __init__(
        self,
        n: int,
        dtype: DTypeLike,
        band: tuple[Array, Array] | None,
        plan: Any = None,
        spectra: tuple[Array, ...] = (),
    ) -> None:
        self.grid_shape, self.dtype, self.points = (n,), np.dtype(dtype), float(n)
        self._band = band
        # The eigenvalues of each embedding, in the order of the plan; empty if the matrix is dense.
        self._plan, self._spectra = plan, spectra

    @classmethod
    def of(cls, column: Array, row: Array, dtype: DTypeLike) -> "ToeplitzProduct":
        """Return the product, constructed from the first column and row.

        Pass the same array twice if the matrix is real and symmetric.
        """
        n = len(column)
        if n <= DENSE:
            return cls(n, dtype, (column, row))
        plan = plan_of(n, dtype)
        return cls(n, dtype, None, plan, _spectra(column, row, np.dtype(dtype), plan))

    def adjoint(self) -> "ToeplitzProduct":
        """Return the multiplication by the conjugate transpose, without any transform."""
        band = self._band and (self._band[1].conj(), self._band[0].conj())
        spectra = tuple(spectrum.conj() for spectrum in self._spectra)
        return ToeplitzProduct(self.grid_shape[0], self.dtype, band, self._plan, spectra)

    def astype(self, dtype: DTypeLike) -> "ToeplitzProduct":
        """Return the multiplication in another precision, without any transform."""
        spectra = tuple(cast_numbers(spectrum, dtype) for spectrum in self._spectra)
        plan = self._plan and self._plan.astype(np.dtype(dtype).char.upper())
        return ToeplitzProduct(self.grid_shape[0], dtype, self._band, plan, spectra)

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm, from the norms of the embeddings of size L."""
        plan, spectra = self._plan, self._spectra
        if not spectra:
            assert self._band is not None
            plan = plan_of(self.grid_shape[0], self.dtype)
            spectra = _spectra(*self._band, self.dtype, plan)
        return float(sum(np.abs(spectrum).max() for spectrum in spectra) * plan.length)

    @cached_property
    def _matrix(self) -> Array:
        assert self._band is not None
        return np.ascontiguousarray(toeplitz(*self._band), self.dtype)

    def __call__(self, X: Array, out: Array | None = None) -> Array:
        """Return what `multiply_rows` returns, with less overhead for a single short vector."""
        n = self.grid_shape[0]
        if n >= LONG or X.shape != (n,) or X.dtype != self.dtype or self.dtype.kind == "c":
            return multiply_rows(self, X, out)
        if not self._spectra:
            y = self._matrix.dot(X)
        else:
            y = self._plan.multiply_vector(X, self._spectra[0])
        count_work(1, self.points)
        if out is None:
            return y
        out[...] = y
        return out

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out` (see `Product`)."""
        if self._spectra:
            self._plan.multiply(X, [(SHIFTS[self.dtype.kind], self._spectra)], out)
        else:
            out[...] = X.astype(self.dtype, copy=False) @ self._matrix.T


def _spectra(
    column: Array, row: Array, dtype: np.dtype[Any], plan: OneStep | FourStep
) -> tuple[Array, ...]:
    """Return the eigenvalues of the embedding of a Toeplitz matrix, in the form for the plan."""
    n = len(column)
    plan, prepare = plan.astype("D"), plan.eigenvalues
    count_transforms(1, 2 * plan.length)
    symmetric = row is column
    ahead = np.zeros(plan.length + 1, np.result_type(column, np.float64))
    ahead[:n] = column
    back = ahead if symmetric else np.zeros_like(ahead)
    back[:n] = row
    if dtype.kind != "c":
        Z = plan.spectrum(ahead[:-1], back[:0:-1], *SHIFTS["f"])
        return (prepare(Z.real if symmetric else Z),)
    hermitian = np.array_equal(row, column.conj())
    spectra = []
    for shift, sign in zip(SHIFTS["c"], (0.5, -0.5), strict=True):
        first = 0.5 * ahead[:-1] + sign * back[:0:-1]
        Z = plan.spectrum(first.real, first.imag, shift)
        spectra.append(prepare(Z.real if hermitian else Z))
    return tuple(spectra)


def cast_numbers(array: Array, dtype: DTypeLike) -> Array:
    """Return numbers in the precision of a dtype; real ones stay real, complex ones complex."""
    char = np.dtype(dtype).char
    return array.astype(char.upper() if array.dtype.kind == "c" else char.lower(), copy=False)


class Transforms(NamedTuple):
    """A transform that diagonalises a class of matrices, and its inverse."""

    forward: Callable[..., Array]
    backward: Callable[..., Array]


# For real circulants, complex circulants, and the matrices diagonalised by the DCT-II, the DST-II
# and the DST-I.
FOURIER = Transforms(fourier.rfftn, fourier.irfftn)
COMPLEX_FOURIER = Transforms(fourier.fftn, fourier.ifftn)
COSINE = Transforms(*[partial(f, norm="ortho") for f in (fourier.dctn, fourier.idctn)])
SINE = Transforms(*[partial(f, norm="ortho") for f in (fourier.dstn, fourier.idstn)])
TAU = Transforms(*[partial(fourier.dstn, type=1, norm="ortho")] * 2)  # DST-I is its own inverse.


class DiagonalisedProduct:
    """Multiplication by a matrix that a fast transform diagonalises, such as a circulant.

    The vectors are grid functions. They are extended by zeros to the size of the matrix, and the
    products are restricted to the grid.

    Parameters
    ----------
    spectrum : ndarray
        The eigenvalues, real if the matrix is Hermitian. For a circulant they are the ``rfftn`` of
        its first column, or the ``fftn`` if it is complex. A matrix that couples the components of
        a field has two leading axes, for the pairs of components.
    fft_shape : tuple of int
        The size of the matrix along each axis.
    grid_shape : tuple of int
        The size of the grid, at most `fft_shape` along each axis, after the number of components if
        the spectrum couples components.
    dtype : float32, float64, complex64 or complex128
        The dtype of the matrix.
    transforms : Transforms
        The transforms, for real or complex numbers as `dtype` requires.
    """

    grid_shape: tuple[int, ...]

    def __init__(
        self,
        spectrum: Array,
        fft_shape: tuple[int, ...],
        grid_shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
        transforms: Transforms = FOURIER,
    ) -> None:
        # One product with a Toeplitz matrix has transforms twice as long on each axis.
        grid = grid_shape[-len(fft_shape) :]
        self._components = prod(grid_shape[: -len(fft_shape)])
        points = self._components * prod(fft_shape) / 2 ** axes_of(grid)
        self.grid_shape, self.dtype, self.points = grid_shape, np.dtype(dtype), points
        self.transforms = transforms
        self.spectrum = cast_numbers(refuse_masked("spectrum", spectrum), self.dtype)
        self.fft_shape = fft_shape
        self._grid, self._axes = grid, tuple(range(-len(grid), 0))
        # Crops all axes except the first, which threads share.
        self._cut: Any = (..., *(slice(n) for n in grid[1:]))

    @property
    def is_hermitian(self) -> bool:
        """Whether the eigenvalues are real, or their matrices exactly Hermitian if coupled."""
        if self.spectrum.dtype.kind != "c":
            return True
        is_coupled = self.grid_shape != self._grid
        return is_coupled and np.array_equal(self.spectrum, self.spectrum.conj().swapaxes(0, 1))

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm: the largest norm of an eigenvalue or coupling matrix."""
        if self.grid_shape == self._grid:
            return float(np.abs(self.spectrum).max())
        return float(np.linalg.norm(self.spectrum, axis=(0, 1)).max())

    def adjoint(self) -> "DiagonalisedProduct":
        """Return the multiplication by the conjugate transpose; for circulants only."""
        is_coupled = self.grid_shape != self._grid
        return self._like(
            self.spectrum.conj().swapaxes(0, 1) if is_coupled else self.spectrum.conj(), self.dtype
        )

    def astype(self, dtype: DTypeLike) -> "DiagonalisedProduct":
        """Return the multiplication in another precision."""
        return self._like(self.spectrum, dtype)

    def _like(self, spectrum: Array, dtype: DTypeLike) -> "DiagonalisedProduct":
        shapes = self.fft_shape, self.grid_shape
        return DiagonalisedProduct(spectrum, *shapes, dtype, self.transforms)

    __call__ = multiply_rows

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out` (see `Product`)."""
        in_batches(self._multiply, X, out, prod(self.fft_shape))

    def _multiply(self, X: Array, out: Array) -> None:
        x, y = (rows.reshape(-1, *self._grid) for rows in (X, out))
        forward, backward = self.transforms
        # Vectors of the size of the matrix need no copy. Others are extended by zeros in a
        # workspace, which real-to-real transforms then overwrite.
        is_whole = self.fft_shape == self._grid and x.dtype == self.dtype
        grid = x if is_whole else workspace((len(x), *self.fft_shape), self.dtype)

        def fill(part: slice) -> None:
            to, of = grid[:, part], x[:, part]
            if self.fft_shape != self._grid:
                to[...] = 0.0
            to[:, : of.shape[1]][self._cut] = of

        def scale(part: slice) -> None:
            if self.grid_shape == self._grid:
                hat[:, part] *= self.spectrum[part]
                return
            fields = hat.reshape(-1, self._components, *hat.shape[1:])[:, :, part]
            columns = enumerate(np.moveaxis(self.spectrum[:, :, part], 1, 0))
            fields[...] = sum(column * fields[:, j, None] for j, column in columns)

        def cut(part: slice) -> None:
            y[:, part] = Y[:, part][self._cut]

        if not is_whole:
            share_rows(fill, grid[0])
        hat = forward(grid, axes=self._axes, overwrite_x=not is_whole)
        share_rows(scale, hat[0])
        Y = backward(hat, s=self.fft_shape, axes=self._axes, overwrite_x=True)
        share_rows(cut, y[0])
