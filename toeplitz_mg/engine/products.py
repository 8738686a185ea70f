"""Multiplication by matrices that fast transforms diagonalise, or a circulant embeds."""

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

NEAR_ONE = 1e-9, 1e9  # Sizes of vectors that are multiplied in single precision as they are.
SHIFTS = {"f": (0.25,), "c": (0.0, 0.5)}  # Of the embeddings of `ToeplitzProduct`.
DENSE = 256  # Unknowns up to which a product with the dense matrix is faster than any transform.


class Product(Protocol):
    """Multiplication of rows by a matrix: what all kinds of products have in common."""

    dtype: np.dtype[Any]  # The precision of the products, whatever that of the vectors.
    points: float  # The work of a product, in grid points.

    def multiply(self, X: Array, out: Array) -> None:
        """Multiply the rows of `X`, of shape (rows, N), into `out`, which may be `X`.

        They are real where the matrix is, and of any kind where that is complex.
        """


def multiply_rows(product: Product, X: Array, out: Array | None = None) -> Array:
    """Multiply the rows of `X`, shape (..., N), into `out`, of the same shape, or a new array.

    It is the ``__call__`` of every product.

    The result has the dtype that NumPy gives to the product of a matrix and a vector of these
    dtypes. `out` may be `X`. A real matrix multiplies the two parts of complex vectors.
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
    if not X.size:  # Vectors are rows here, and there may be none.
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
    """Multiply rows of double precision by a matrix of single precision, whose range is small.

    Where they are far from 1 they are scaled by powers of two, which changes no digit.
    """
    low, high = NEAR_ONE
    find = izamax if rows.dtype.char == "D" else idamax  # Of one row it takes a single call.
    if all(low < abs(row[find(row)]) < high for row in rows):
        product.multiply(rows, out)
        return
    peaks = np.abs(rows).max(axis=1, keepdims=True)
    powers = np.where(np.isfinite(peaks), power_above(peaks), 0)
    product.multiply(rows * np.ldexp(1.0, -powers), out)
    for part in (out.real, out.imag) if out.dtype.kind == "c" else (out,):
        part *= np.ldexp(1.0, powers)


class ToeplitzProduct:
    """Multiplication by a Toeplitz matrix of one axis.

    Up to `DENSE` unknowns it is by the matrix itself. A larger real one is embedded in a matrix of
    size L ≥ n that is circulant but for a factor i on what goes around: with the lags a,

        Re of the matrix with the first column a_k + i a_(k-L)    (k = 0 … L - 1)

    has the Toeplitz matrix as its leading block, as what goes around is imaginary. The transform
    at the frequencies k + 1/4 diagonalises it: one complex transform each way, of length n in the
    place of real ones of length 2 n that are half zeros. Of a symmetric matrix the eigenvalues are
    real, Σ a_k cos kθ.

    A complex matrix is embedded in the mean of a circulant and a skew-circulant of size L, with the
    first columns a_k ± a_(k-L), which transforms at the frequencies k and k + 1/2 diagonalise.

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
        # Of each matrix in which this one is embedded, in the order of the plan; none if it is
        # small.
        self._plan, self._spectra = plan, spectra

    @classmethod
    def of(cls, column: Array, row: Array, dtype: DTypeLike) -> "ToeplitzProduct":
        """Make the product from the first column and row.

        They are the same array where the matrix is real and symmetric.
        """
        n = len(column)
        if n <= DENSE:
            return cls(n, dtype, (column, row))
        plan = plan_of(n, dtype)
        return cls(n, dtype, None, plan, _spectra(column, row, np.dtype(dtype), plan))

    def adjoint(self) -> "ToeplitzProduct":
        """Return the multiplication by the conjugate transpose; no transform is made."""
        band = self._band and (self._band[1].conj(), self._band[0].conj())
        spectra = tuple(spectrum.conj() for spectrum in self._spectra)
        return ToeplitzProduct(self.grid_shape[0], self.dtype, band, self._plan, spectra)

    def astype(self, dtype: DTypeLike) -> "ToeplitzProduct":
        """Return the multiplication in another precision; no transform is made."""
        spectra = tuple(cast_numbers(spectrum, dtype) for spectrum in self._spectra)
        plan = self._plan and self._plan.astype(np.dtype(dtype).char.upper())
        return ToeplitzProduct(self.grid_shape[0], dtype, self._band, plan, spectra)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: that of the matrix of size L."""
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
        """Do what `multiply_rows` does, and a single short vector with fewer calls."""
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
    """Return the eigenvalues of the embedding of a Toeplitz matrix, as the plan needs them."""
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
    """Bring numbers, real ones or complex ones, to the precision of a dtype of either kind."""
    char = np.dtype(dtype).char
    return array.astype(char.upper() if array.dtype.kind == "c" else char.lower(), copy=False)


class Transforms(NamedTuple):
    """A transform that diagonalises an algebra of matrices, and its inverse."""

    forward: Callable[..., Array]
    backward: Callable[..., Array]


# These diagonalise circulants, real and complex ones, and the matrices of the DCT-II, of the DST-II
# and of the DST-I.
FOURIER = Transforms(fourier.rfftn, fourier.irfftn)
COMPLEX_FOURIER = Transforms(fourier.fftn, fourier.ifftn)
COSINE = Transforms(*[partial(f, norm="ortho") for f in (fourier.dctn, fourier.idctn)])
SINE = Transforms(*[partial(f, norm="ortho") for f in (fourier.dstn, fourier.idstn)])
TAU = Transforms(*[partial(fourier.dstn, type=1, norm="ortho")] * 2)  # It is its own inverse.


class DiagonalisedProduct:
    """Multiplication by a matrix that a fast transform diagonalises, as a circulant.

    The vectors live on a grid, are extended by zeros to the size of the matrix, and cut again.

    Parameters
    ----------
    spectrum : ndarray
        The eigenvalues, real where the matrix is Hermitian; of a circulant the ``rfftn`` of its
        first column, or the ``fftn`` where that is complex. Of matrices between the components of
        a field those of each pair, along two axes before these.
    fft_shape : tuple of int
        The size of the matrix along each axis.
    grid_shape : tuple of int
        The size of the vectors, at most `fft_shape` along each axis; before it the components,
        where the spectrum has those.
    dtype : float32, float64, complex64 or complex128
        That of the matrix.
    transforms : Transforms
        Of numbers of that kind.
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
        # A product with a Toeplitz matrix on this grid has transforms twice as long on each axis.
        grid = grid_shape[-len(fft_shape) :]
        self._components = prod(grid_shape[: -len(fft_shape)])
        points = self._components * prod(fft_shape) / 2 ** axes_of(grid)
        self.grid_shape, self.dtype, self.points = grid_shape, np.dtype(dtype), points
        self.transforms = transforms
        self.spectrum = cast_numbers(refuse_masked("spectrum", spectrum), self.dtype)
        self.fft_shape = fft_shape
        self._grid, self._axes = grid, tuple(range(-len(grid), 0))
        # The first axis is taken by parts, which are cut where these are.
        self._cut: Any = (..., *(slice(n) for n in grid[1:]))

    @property
    def is_hermitian(self) -> bool:
        """Whether the eigenvalues are real, or those matrices Hermitian to the last bit."""
        if self.spectrum.dtype.kind != "c":
            return True
        is_coupled = self.grid_shape != self._grid
        return is_coupled and np.array_equal(self.spectrum, self.spectrum.conj().swapaxes(0, 1))

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: the largest size of an eigenvalue, or of such a matrix."""
        if self.grid_shape == self._grid:
            return float(np.abs(self.spectrum).max())
        return float(np.linalg.norm(self.spectrum, axis=(0, 1)).max())

    def adjoint(self) -> "DiagonalisedProduct":
        """Return the multiplication by the conjugate transpose of a circulant."""
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
        # Vectors that fill the matrix are transformed where they are. Others are extended by zeros
        # in memory where transforms to real numbers stay.
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
