"""A Toeplitz matrix of any kind, and circulant preconditioners, in the Fourier domain.

A Toeplitz matrix is half the sum of a circulant and a skew-circulant, in which the lags k - n have
the opposite sign. In the Fourier domain the circulant and the preconditioner are diagonal. The
skew-circulant takes four transforms; for real vectors of length n two of these have half that
length.
"""

from collections.abc import Callable

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.fourier import fft, ifft, packed_irfft, packed_rfft
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import LONG, plan_of
from toeplitz_mg.engine.vectors import VECTORS
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators.positivity import require_nonzero

ROOT = np.sqrt(2.0)


def has_fourier_form(n: int) -> bool:
    """Whether a matrix of this size has the form: an even fast length, short enough."""
    return n % 2 == 0 and 2 * n <= LONG and near_fast_length(n) == n


class FourierForm:
    """A Toeplitz matrix as F A Fᴴ, with the unitary Fourier transform F.

    The transform of a real vector is stored as n real numbers in the order of FFTPACK: the
    frequency 0, then the real and imaginary part of each other one, and n/2 last. Both ends are
    divided by √2, because each other frequency stands for two. Inner products are kept up to a
    factor.

    Parameters
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row, both real or both complex.

    Attributes
    ----------
    A : operator for `gmres` and `cg`
        The matrix in that domain.
    """

    def __init__(self, c: Array, r: Array) -> None:
        self.n = n = len(c)
        self._is_complex = c.dtype.kind == "c"
        behind = np.concatenate([np.zeros(1, r.dtype), r[:0:-1]])  # The lags k - n.
        count_transforms(2, n)
        transform = fft if self._is_complex else packed_rfft
        self._circulant = _Diagonal(0.5 * transform(c + behind), c.dtype)
        twist = plan_of(n, np.complex128, exact=True).weights(0.5)
        self._twist = twist if self._is_complex else twist[: n // 2]
        self._untwist = self._twist.conj()
        self._skew = fft(self._fold(0.5 * (c - behind)))
        self.A = Multiplication(n, c.dtype, self._multiply)

    def inverse(self, eigenvalues: Array) -> "_Diagonal":
        """Return the inverse of a circulant, a diagonal matrix in that domain.

        Raises
        ------
        numpy.linalg.LinAlgError
            If an eigenvalue is zero.
        """
        require_nonzero(eigenvalues, self.A.dtype, "the circulant has the eigenvalue", "gmres")
        values = 1.0 / eigenvalues
        return _Diagonal(values if self._is_complex else _pack(values), self.A.dtype)

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows by A, outside of that domain."""
        return self.transform_back(self.A.apply(self.transform(X)))

    def transform(self, X: Rows) -> Rows:
        """Return the transforms of rows."""
        count_transforms(X.size // self.n, self.n)
        if self._is_complex:
            return fft(X) / np.sqrt(self.n)
        Z = packed_rfft(X) * np.sqrt(2.0 / self.n)
        Z[..., :: self.n - 1] /= ROOT
        return Z

    def transform_back(self, Z: Rows) -> Rows:
        """Return the rows with these transforms."""
        count_transforms(Z.size // self.n, self.n)
        if self._is_complex:
            return ifft(Z) * np.sqrt(self.n)
        X = Z * np.sqrt(0.5 * self.n)
        X[..., :: self.n - 1] *= ROOT
        return packed_irfft(X, overwrite_x=True)

    def _multiply(self, X: Rows, out: Rows) -> Rows:
        """Multiply transformed rows by A, into `out`, which may be `X`."""
        count_transforms(4 * (X.size // self.n), self.n)
        if self._is_complex:
            x = ifft(X)
        else:
            x = X.copy()
            x[..., :: self.n - 1] *= ROOT
            x = packed_irfft(x, overwrite_x=True)
        Z = fft(self._fold(x), overwrite_x=True)
        Z *= self._skew
        Z = ifft(Z, overwrite_x=True)
        Z *= self._untwist
        if self._is_complex:
            Y = fft(Z, overwrite_x=True)
        else:
            h = self.n // 2
            x[..., :h] = Z.real
            np.negative(Z.imag, out=x[..., h:])
            Y = packed_rfft(x, overwrite_x=True)
            Y[..., :: self.n - 1] /= ROOT
        self._circulant.apply(X, out)
        out += Y
        return out

    def _fold(self, x: Rows) -> Rows:
        """Return rows whose transforms are those of `x` at the frequencies k + 1/2.

        For real rows only those with even k are returned, of half the length; the others are their
        conjugates.
        """
        if self._is_complex:
            return x * self._twist
        h = self.n // 2
        Z = np.empty((*x.shape[:-1], h), self._twist.dtype)
        Z.real = x[..., :h]
        np.negative(x[..., h:], out=Z.imag)
        Z *= self._twist
        return Z


def _pack(z: Array) -> Array:
    """Return the frequencies 0 … n/2 in the order of FFTPACK."""
    z = z.astype(np.complex128)
    return np.concatenate([z[:1].real, z[1:-1].view(np.float64), z[-1:].real])


class _Diagonal:
    """A circulant in the transformed domain, given by its eigenvalues in the same order."""

    vectors = VECTORS

    def __init__(self, eigenvalues: Array, dtype: np.dtype[np.generic]) -> None:
        self.dtype, self.shape = dtype, 2 * (len(eigenvalues),)
        # A cast of real numbers in each product with complex ones would take as long as that.
        self._eigenvalues = eigenvalues.astype(np.result_type(eigenvalues, dtype), copy=False)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        values = self._eigenvalues
        if self.dtype.kind == "c":
            return np.multiply(X, values, out=out)
        out = np.empty_like(X) if out is None else out
        n = len(values)
        np.multiply(X[..., :: n - 1], values[:: n - 1], out=out[..., :: n - 1])
        x, d, y = (a[..., 1:-1].view(np.complex128) for a in (X, values, out))
        np.multiply(x, d, out=y)
        return out


class Multiplication:
    """A matrix given by the function ``multiply(X, out)`` for rows."""

    vectors = VECTORS

    def __init__(
        self, n: int, dtype: np.dtype[np.generic], multiply: Callable[[Rows, Rows], Rows]
    ) -> None:
        self.dtype, self.shape = dtype, (n, n)
        self._multiply = multiply

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self._multiply(X, np.empty_like(X) if out is None else out)
