"""A Toeplitz matrix of any kind, and circulants that approximate it, in the Fourier domain.

A Toeplitz matrix is half the sum of a circulant and of a skew-circulant, in which the lags k - n
have the other sign. In that domain the one is a diagonal, as what preconditions is, and the other
takes four transforms: of real vectors of length n two of these, and two of half that length.
"""

from collections.abc import Callable

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import phase_factors
from toeplitz_mg.engine.vectors import ALONE
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.circulant import smooth_column
from toeplitz_mg.preconditioners.positivity import require_nonzero

LARGEST = 2**14  # Most unknowns of which a transform at once is as fast as one in panels.
ROOT = np.sqrt(2.0)


def has_fourier_form(n: int) -> bool:
    """Whether a matrix of this size has the form: of an even size, with fast transforms."""
    return n % 2 == 0 and n <= LARGEST and near_fast_length(n) == n


class FourierForm:
    """A Toeplitz matrix as F A Fᴴ, with F the unitary Fourier transform.

    The transform of a real vector is kept as n real numbers: those of the frequencies 0 and n/2,
    and then the parts of the others, times √2, as each of them stands for two. So inner products
    are those of the vectors.

    Parameters
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row, both real or both complex.

    Attributes
    ----------
    A : operator for `gmres` and `cg`
        The matrix in that domain.
    samples : ndarray
        Samples of the symbol, as `smooth_eigenvalues` returns them.
    """

    def __init__(self, c: Array, r: Array) -> None:
        self.n = n = len(c)
        self._is_complex = c.dtype.kind == "c"
        behind = np.concatenate([np.zeros(1, r.dtype), r[:0:-1]])  # The lags k - n.
        count_transforms(3, n)
        transform = fft.fft if self._is_complex else fft.rfft
        self.samples = transform(smooth_column(c, r))
        self._circulant = _Diagonal(0.5 * transform(c + behind), n, c.dtype)
        twist = phase_factors(n, 0.5, np.dtype(np.complex128))
        self._twist = twist if self._is_complex else twist[: n // 2]
        self._untwist = self._twist.conj()
        self._skew = fft.fft(self._fold(0.5 * (c - behind)))
        self.A = _Operator(n, c.dtype, self._multiply)

    def inverse(self, eigenvalues: Array) -> "_Diagonal":
        """Return the inverse of a circulant in that domain, where it is a diagonal.

        Raises
        ------
        numpy.linalg.LinAlgError
            Where an eigenvalue is zero.
        """
        require_nonzero(eigenvalues, self.A.dtype, "the circulant has the eigenvalue", "gmres")
        return _Diagonal(1.0 / eigenvalues, self.n, self.A.dtype)

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows by A, in no domain but their own."""
        return self.transform_back(self.A.apply(self.transform(X)))

    def transform(self, X: Rows) -> Rows:
        """Return rows in the domain of the transform."""
        count_transforms(X.size // self.n, self.n)
        if self._is_complex:
            return fft.fft(X, norm="ortho")
        Y = fft.rfft(X, norm="ortho")
        Z = np.empty(X.shape)
        np.multiply(Y[..., :-1], ROOT, out=Z.view(Y.dtype))
        Z[..., 0], Z[..., 1] = Y[..., 0].real, Y[..., -1].real
        return Z

    def transform_back(self, Z: Rows) -> Rows:
        """Return the rows that rows in the domain of the transform stand for."""
        count_transforms(Z.size // self.n, self.n)
        if self._is_complex:
            return fft.ifft(Z, norm="ortho")
        return fft.irfft(self._unpack(Z), self.n, norm="ortho", overwrite_x=True) / ROOT

    def within(
        self, solve: Callable[[Rows, float], tuple[Rows, int]]
    ) -> Callable[[Rows, float], tuple[Rows, int]]:
        """Return the solver for rows as they are, of one for rows in that domain."""

        def solve_within(B: Rows, rtol: float) -> tuple[Rows, int]:
            X, iterations = solve(self.transform(B), rtol)
            return self.transform_back(X), iterations

        return solve_within

    def _multiply(self, X: Rows, out: Rows) -> Rows:
        """Multiply rows in the domain of the transform by A, into `out`, which may be `X`."""
        count_transforms(4 * (X.size // self.n), self.n)
        n, h = self.n, self.n // 2
        x = fft.ifft(X) if self._is_complex else fft.irfft(self._unpack(X), n, overwrite_x=True)
        Z = fft.fft(self._fold(x), overwrite_x=True)
        Z *= self._skew
        Z = fft.ifft(Z, overwrite_x=True)
        Z *= self._untwist
        self._circulant.apply(X, out)
        if self._is_complex:
            out += fft.fft(Z, overwrite_x=True)
            return out
        x[..., :h] = Z.real
        np.negative(Z.imag, out=x[..., h:])
        Y = fft.rfft(x)
        out.view(Y.dtype)[..., 1:] += Y[..., 1:-1]
        out[..., 0] += Y[..., 0].real / ROOT
        out[..., 1] += Y[..., -1].real / ROOT
        return out

    def _unpack(self, Z: Rows) -> Rows:
        """Return √2 times the transforms of real rows, for frequencies up to n/2."""
        Y = np.empty((*Z.shape[:-1], self.n // 2 + 1), np.complex128)
        Y[..., 1:-1] = Z.view(Y.dtype)[..., 1:]
        Y[..., 0], Y[..., -1] = ROOT * Z[..., 0], ROOT * Z[..., 1]
        return Y

    def _fold(self, x: Rows) -> Rows:
        """Return rows whose transforms are those of `x` at the frequencies k + 1/2.

        Of real rows they are those for even k alone, of half the length: the others are their
        conjugates.
        """
        if self._is_complex:
            return x * self._twist
        h = self.n // 2
        Z = np.empty((*x.shape[:-1], h), np.complex128)
        Z.real = x[..., :h]
        np.negative(x[..., h:], out=Z.imag)
        Z *= self._twist
        return Z


class _Diagonal:
    """A circulant in the domain of the transform."""

    vectors = ALONE

    def __init__(self, eigenvalues: Array, n: int, dtype: np.dtype[np.generic]) -> None:
        self.dtype, self.shape = dtype, (n, n)
        self._eigenvalues, self._ends = eigenvalues, None
        if self.dtype.kind != "c":
            self._eigenvalues = eigenvalues[:-1].astype(np.complex128)
            self._ends = eigenvalues[[0, -1]].real

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        if self._ends is None:
            return np.multiply(X, self._eigenvalues, out=out)
        out = np.empty_like(X) if out is None else out
        ends = X[..., :2] * self._ends
        numbers = self._eigenvalues.dtype
        np.multiply(X.view(numbers), self._eigenvalues, out=out.view(numbers))
        out[..., :2] = ends
        return out


class _Operator:
    """A matrix that a function multiplies."""

    vectors = ALONE

    def __init__(
        self, n: int, dtype: np.dtype[np.generic], multiply: Callable[[Rows, Rows], Rows]
    ) -> None:
        self.dtype, self.shape = dtype, (n, n)
        self._multiply = multiply

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self._multiply(X, np.empty_like(X) if out is None else out)
