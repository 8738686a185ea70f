"""The FFT engine behind every product: matrices that fast transforms diagonalise, or embed."""

from collections.abc import Callable
from functools import cached_property, lru_cache, partial
from itertools import count
from math import prod
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import fft

from toeplitz_mg.operators.fourstep import FourStep, four_step
from toeplitz_mg.operators.work import count_transforms, count_work
from toeplitz_mg.operators.workspace import workspace

Array = NDArray[Any]

DENSE = 160  # unknowns up to which a dense product is faster than any transform
LONG = 2**15  # length from which a transform in four steps is faster than one
BATCH = 2**15  # numbers of a batch of short vectors that stays in the cache


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


def cosine_sums(column: Array) -> Array:
    """Return f_k = Σ a_j cos(πjk/n) over all lags |j| ≤ n, for k = 0 … n, a of period 2 n.

    A DCT-I; of several levels if there are. It is its own inverse but for the factor 2 n a level.

    Parameters
    ----------
    column : ndarray of shape (n + 1, ...), float64
    """
    shape = tuple(m - 1 for m in column.shape)
    count_transforms(1, *shape)  # half as long as those of a product
    if len(shape) == 1 and shape[0] % 2 == 0:
        lines = _lines(shape[0], np.float64, exact=True)
        if isinstance(lines, Panels):
            return lines.cosine_sums(column)
    return np.asarray(fft.dctn(column, type=1))


class Product:
    """Multiplication of rows by a real matrix: what the kinds of products have in common.

    Parameters
    ----------
    grid_shape : tuple of int
    dtype : float32 or float64
        The precision of the products, whatever that of the vectors.
    points : float
        The work of a product, in grid points.
    """

    def __init__(self, grid_shape: tuple[int, ...], dtype: DTypeLike, points: float) -> None:
        self.grid_shape = grid_shape
        self.dtype = np.dtype(dtype)
        self._points = points

    def __call__(self, X: Array, out: Array | None = None) -> Array:
        """Multiply the rows of `X`, shape (..., N), into `out`, of the same shape, or a new array.

        The result has the dtype that NumPy gives to the product of a matrix and a vector of these
        dtypes. `out` may be `X`.
        """
        if np.iscomplexobj(X):
            real, imag = self(X.real), self(X.imag)
            out = np.empty(X.shape, np.result_type(X, self.dtype)) if out is None else out
            out.real, out.imag = real, imag
            return out
        if out is None:
            out = np.empty(X.shape, np.result_type(X, self.dtype))
        n = prod(self.grid_shape)
        rows = X.reshape(-1, n)
        count_work(len(rows), self._points)
        self._multiply(rows, out.reshape(-1, n))
        return out

    def _multiply(self, X: Array, out: Array) -> None:
        raise NotImplementedError


class ToeplitzProduct(Product):
    """Multiplication by a real Toeplitz matrix of one level.

    Up to some size by the matrix itself. Beyond it is embedded in a matrix of size L ≥ n that is
    circulant but for a factor i on what goes around: with the lags a,

        Re of the matrix with the first column a_k + i a_(k-L)    (k = 0 … L - 1)

    has the Toeplitz matrix as its leading block, as what goes around is imaginary. The transform
    at the frequencies k + 1/4 diagonalises it: one complex transform each way, of length n in the
    place of real ones of length 2 n that are half zeros. Of a symmetric matrix the eigenvalues are
    real, Σ a_k cos kθ.

    References
    ----------
    R. Crandall, B. Fagin, Discrete weighted transforms and large-integer arithmetic, Math. Comp.
    62 (1994): "right-angle convolution".
    """

    def __init__(self, lags: Array, dtype: DTypeLike, *, symmetric: bool) -> None:
        n = (len(lags) + 1) // 2
        super().__init__((n,), dtype, n)
        self._lags = lags
        self._symmetric = symmetric
        if n > DENSE:
            _ = self.spectrum  # made now, not with the first product

    def adjoint(self) -> "ToeplitzProduct":
        """Return the multiplication by the transpose."""
        adjoint = ToeplitzProduct.__new__(ToeplitzProduct)
        Product.__init__(adjoint, self.grid_shape, self.dtype, self._points)
        adjoint._lags, adjoint._symmetric = self._lags[::-1], self._symmetric
        if "spectrum" in self.__dict__:
            adjoint.__dict__["spectrum"] = self.spectrum.conj()  # no transform is made
        return adjoint

    @cached_property
    def spectrum(self) -> Array:
        """The eigenvalues, as the transform needs them."""
        (n,) = self.grid_shape
        a = self._lags.astype(np.float64, copy=False)
        lines = _lines(n, np.float64)
        count_transforms(1, 2 * lines.length)
        column = np.zeros(lines.length, np.complex128)
        column[:n] = a[n - 1 :]
        column.imag[lines.length - n + 1 :] = a[: n - 1]
        Z = lines.spectrum(column, 0.25)
        return _lines(n, self.dtype).eigenvalues(Z.real if self._symmetric else Z)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: that of the matrix of size L."""
        (n,) = self.grid_shape
        return float(np.abs(self.spectrum).max() * _lines(n, np.float64).length)

    @cached_property
    def _matrix(self) -> Array:
        """The transpose of the matrix."""
        (n,) = self.grid_shape
        windows = np.lib.stride_tricks.sliding_window_view(self._lags, n)
        return np.ascontiguousarray(windows[::-1].astype(self.dtype, copy=False))

    def _multiply(self, X: Array, out: Array) -> None:
        (n,) = self.grid_shape
        if n <= DENSE:
            out[...] = X.astype(self.dtype, copy=False) @ self._matrix
        else:
            _lines(n, self.dtype).multiply_real(X, self.spectrum, out)


class Transforms(NamedTuple):
    """A transform that diagonalises an algebra of matrices, and its inverse."""

    forward: Callable[..., Array]
    backward: Callable[..., Array]


FOURIER = Transforms(fft.rfftn, fft.irfftn)  # circulants
COSINE = Transforms(partial(fft.dctn, norm="ortho"), partial(fft.idctn, norm="ortho"))  # DCT-II
SINE = Transforms(partial(fft.dstn, norm="ortho"), partial(fft.idstn, norm="ortho"))  # DST-II


class Convolution(Product):
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
        # The share of a product on this grid, whose transforms are twice as long in each level.
        embedded = transforms is FOURIER and fft_shape != grid_shape
        points = prod(grid_shape) / (1 if embedded else 2 ** len(grid_shape))
        super().__init__(grid_shape, dtype, points)
        self.transforms = transforms
        # float32 -> complex64 or float32: the spectrum in the precision of the products.
        precision = np.result_type(self.dtype, np.complex64)
        if not np.iscomplexobj(spectrum):
            precision = self.dtype
        self.spectrum = spectrum.astype(precision, copy=False)
        self.fft_shape = fft_shape
        self._axes = tuple(range(-len(grid_shape), 0))
        self._cut: Any = (..., *(slice(n) for n in grid_shape))

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

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm: that of the matrix that is diagonalised."""
        return float(np.abs(self.spectrum).max())

    def adjoint(self) -> Self:
        """Return the multiplication by the transpose; no transform is made."""
        conjugate = self.spectrum.conj()
        return type(self)(conjugate, self.fft_shape, self.grid_shape, self.dtype, self.transforms)

    def _multiply(self, X: Array, out: Array) -> None:
        grid = X.reshape(-1, *self.grid_shape).astype(self.dtype, copy=False)
        forward, backward = self.transforms
        hat = forward(grid, s=self.fft_shape, axes=self._axes)
        hat *= self.spectrum
        Y = backward(hat, s=self.fft_shape, axes=self._axes, overwrite_x=True)[self._cut]
        out[...] = Y.reshape(X.shape)


class GohbergSemenculProduct(Product):
    """Multiplication by Re z + J Im z, z = C Sᵀ (v + i J v), for a vector v and its reversal J v.

    C and S are the circulant and the skew-circulant with one first column, both of its size n.
    Four transforms of length n, as much work as two products with a Toeplitz matrix of that size.

    Parameters
    ----------
    column : ndarray of shape (n,), float64
    dtype : float32 or float64
    """

    def __init__(self, column: Array, dtype: DTypeLike) -> None:
        n = len(column)
        super().__init__((n,), dtype, 2.0 * n)
        lines = _lines(n, np.float64, exact=True)
        count_transforms(2, 2 * n)
        eigenvalues = _lines(n, dtype, exact=True).eigenvalues
        column = column.astype(np.complex128)
        # At the frequencies k - 1/2 of the skew-circulant, conjugated for its transpose.
        self._factors = [
            (0.5, eigenvalues(lines.spectrum(column, 0.5).conj())),
            (0.0, eigenvalues(lines.spectrum(column, 0.0))),
        ]

    def _multiply(self, X: Array, out: Array) -> None:
        lines = _lines(len(X.T), self.dtype, exact=True)
        lines.multiply_folded(X, self._factors, out)


class TriangularProducts(Product):
    """The same from products with triangular Toeplitz matrices, L Lᵀ - U Uᵀ, twice the work.

    Their transforms may be longer than n, where those of length n are slow.
    """

    def __init__(self, column: Array, dtype: DTypeLike) -> None:
        n = len(column)
        super().__init__((n,), dtype, 0.0)  # they count themselves
        zeros = np.zeros(n - 1)
        columns = column * np.sqrt(2.0), np.append(0.0, column[:0:-1] * np.sqrt(2.0))
        factors = [
            ToeplitzProduct(np.concatenate([zeros, x]), dtype, symmetric=False) for x in columns
        ]
        self._factors = [(factor, factor.adjoint()) for factor in factors]

    def _multiply(self, X: Array, out: Array) -> None:
        (L, L_T), (U, U_T) = self._factors
        Y = U(U_T(X))
        np.subtract(L(L_T(X)), Y, out=out)


class OneStep:
    """Transforms of a length at once: many short vectors, or those of no near, fast factors."""

    def __init__(self, length: int, dtype: DTypeLike) -> None:
        self.length = length
        self.dtype = np.dtype(dtype)

    def weights(self, shift: float) -> Array:
        """The factors exp(-2πi j s/L) of a shift, shape (L,)."""
        return _weights(self.length, shift, self.dtype)

    def spectrum(self, column: Array, shift: float) -> Array:
        """Transform a vector at the frequencies k + s."""
        return np.asarray(fft.fft(column * self.weights(shift)))

    def eigenvalues(self, spectrum: Array) -> Array:
        """Prepare a spectrum for the products."""
        spectrum = spectrum / self.length
        if np.iscomplexobj(spectrum):
            return spectrum.astype(self.dtype)
        # Twice, for the real and the imaginary part.
        return np.repeat(spectrum, 2).astype(self.dtype.char.lower())

    def multiply_real(self, X: Array, eigenvalues: Array, out: Array) -> None:
        """Multiply rows; of the result the real part, for the shift 1/4."""
        n = X.shape[1]
        w, w_conj = self.weights(0.25)[:n], self.weights(-0.25)[:n]
        batch = max(1, BATCH // self.length)
        for start in range(0, len(X), batch):
            part = slice(start, start + batch)
            Z = workspace("one step", (len(X[part]), self.length), self.dtype)
            np.multiply(X[part], w, out=Z[:, :n], casting="same_kind")
            Z[:, n:] = 0.0
            Z = fft.fft(Z, overwrite_x=True)
            pairs = Z.view(eigenvalues.dtype)
            pairs *= eigenvalues
            # The inverse transform, but for its factor 1/L, which the eigenvalues have.
            Z = fft.ifft(Z, overwrite_x=True, norm="forward")[:, :n]
            Z *= w_conj
            out[part] = Z.real

    def multiply_folded(self, X: Array, factors: list[tuple[float, Array]], out: Array) -> None:
        """As `GohbergSemenculProduct`."""
        batch = max(1, BATCH // self.length)
        for start in range(0, len(X), batch):
            part = slice(start, start + batch)
            Z = workspace("one step", (len(X[part]), self.length), self.dtype)
            Z.real, Z.imag = X[part], X[part, ::-1]
            for shift, eigenvalues in factors:
                if shift:
                    Z *= self.weights(shift)
                Z = fft.fft(Z, overwrite_x=True)
                Z *= eigenvalues
                Z = fft.ifft(Z, overwrite_x=True, norm="forward")
                if shift:
                    Z *= self.weights(shift).conj()
            np.add(Z.real, Z.imag[:, ::-1], out=out[part])


@lru_cache(maxsize=64)
def _weights(length: int, shift: float, dtype: np.dtype[Any]) -> Array:
    return np.asarray(np.exp(-2j * np.pi * shift / length * np.arange(length)), dtype)


class Panels:
    """The same by `FourStep`, a row after the other."""

    def __init__(self, plan: FourStep) -> None:
        self.plan = plan
        self.length = plan.length

    def spectrum(self, column: Array, shift: float) -> Array:
        """Transform a vector at the frequencies k + s, in the order of the plan."""
        matrix = column.reshape(self.plan.shape)
        u = self.plan.weights(shift)

        def load(columns: slice, P: Array) -> None:
            np.multiply(matrix[:, columns], u, out=P)

        return self.plan.spectrum(load, shift)

    def eigenvalues(self, spectrum: Array) -> Array:
        """Prepare a spectrum for the products."""
        return self.plan.eigenvalues(spectrum)

    def cosine_sums(self, a: Array) -> Array:
        """As the function of that name, for a of shape (L + 1,), L even.

        Those of even k are the transform of e_j = a_j + a_(L-j); those of odd k are that of
        o_j = a_j - a_(L-j), at the frequencies k + 1/2. Both are real: one transform has both.
        """
        L = self.length
        ahead, back = (x.reshape(self.plan.shape) for x in (a[:-1], a[:0:-1]))
        rows, columns_of = self.plan.shape
        u = 1j * np.exp(-1j * np.pi / rows * np.arange(rows))[:, np.newaxis]
        v = np.exp(-1j * np.pi / L * np.arange(columns_of))

        def load(columns: slice, P: Array) -> None:
            x, y = ahead[:, columns], back[:, columns]
            np.multiply(x - y, u, out=P)
            P *= v[columns]
            real = P.real
            real += x
            real += y

        Z = self.plan.spectrum(load, 0.0)[:, : columns_of // 2 + 1]
        f = np.empty(L + 1)
        f[::2] = Z.real.T.ravel()[: L // 2 + 1]
        f[1::2] = Z.imag.T.ravel()[: L // 2]
        return f

    def multiply_real(self, X: Array, eigenvalues: Array, out: Array) -> None:
        """Multiply rows; of the result the real part, for the shift 1/4."""
        plan = self.plan
        columns_of, n = plan.shape[1], X.shape[1]
        whole, rest = divmod(n, columns_of)  # rows of the matrix, and what is left of the vector
        u = plan.weights(0.25)
        for x, y in zip(X, out, strict=True):
            x_matrix = x[: n - rest].reshape(whole, columns_of)
            y_matrix = y[: n - rest].reshape(whole, columns_of)

            def load(columns: slice, P: Array, x: Array = x, matrix: Array = x_matrix) -> None:
                P[:whole] = matrix[:, columns]
                P[:whole] *= u[:whole]
                if whole < len(P):
                    P[whole:] = 0.0
                    tail = x[n - rest :][columns]
                    P[whole, : len(tail)] = tail * u[whole, 0]

            def store(columns: slice, Q: Array, y: Array = y, matrix: Array = y_matrix) -> None:
                Q *= u
                matrix[:, columns] = Q.real[:whole]
                if rest:
                    tail = y[n - rest :][columns]
                    tail[...] = Q.real[whole, : len(tail)]

            plan.multiply(load, [(0.25, eigenvalues)], store)

    def multiply_folded(self, X: Array, factors: list[tuple[float, Array]], out: Array) -> None:
        """As `GohbergSemenculProduct`; the length is that of the rows."""
        plan = self.plan
        u = plan.weights(factors[0][0])
        z = workspace("four-step result", plan.shape, plan.dtype)
        for x, y in zip(X, out, strict=True):
            matrix = x.reshape(plan.shape)

            def load(columns: slice, P: Array, matrix: Array = matrix) -> None:
                P.real, P.imag = matrix[:, columns], matrix[::-1, ::-1][:, columns]
                P *= u

            def store(columns: slice, Q: Array) -> None:
                z[:, columns] = Q  # the last shift is 0, and u is 1

            plan.multiply(load, factors, store)
            Y = y.reshape(plan.shape)
            np.subtract(z.real, z.imag[::-1, ::-1], out=Y)


@lru_cache(maxsize=64)
def _plan(n: int, precision: str, exact: bool) -> "OneStep | Panels":
    if n < LONG:
        return OneStep(n if exact else fft.next_fast_len(n), precision)
    plan = four_step(n, precision)
    return OneStep(n, precision) if exact and plan.length != n else Panels(plan)


def _lines(n: int, dtype: DTypeLike, *, exact: bool = False) -> "OneStep | Panels":
    """Return the transforms for vectors of length n: of that length, or of a fast one above it."""
    return _plan(n, np.result_type(dtype, np.complex64).char, exact)
