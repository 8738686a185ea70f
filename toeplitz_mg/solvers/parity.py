"""A symmetric Toeplitz matrix on the even and the odd part of vectors, which it never mixes.

It commutes with the flip of a vector, as a symmetric circulant does. So A M is two matrices of half
the size, and each has a space of its own in which GMRES makes the residual least: that saves a
quarter of the iterations.

References
----------
A. L. Andrew, Eigenvectors of certain matrices, Linear Algebra Appl. 7 (1973), for the two parts;
S. A. Martucci, Symmetric convolution and the discrete sine and cosine transforms, IEEE Trans.
Signal Process. 42 (1994), for the transforms.
"""

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.transforms import phase_factors
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.preconditioners.positivity import require_nonzero
from toeplitz_mg.solvers.compiled_transforms import transforms
from toeplitz_mg.solvers.fourier_form import Multiplication

ROOT = np.sqrt(0.5)


def split(X: Rows, out: Rows | None = None) -> Rows:
    """Return the even part of each row, then the odd one, of half the length each, in `out`.

    Inner products stay what they are. Where the length is odd the number in the middle is even, and
    the odd part has a zero beside it.

    Examples
    --------
    >>> split(np.array([3.0, 2.0, -1.0])).round(3)
    array([1.414, 2.   , 2.828, 0.   ])
    """
    n = X.shape[-1]
    half = (n + 1) // 2
    out = np.empty((*X.shape[:-1], 2 * half)) if out is None else out
    even, odd = out[..., :half], out[..., half:]
    first, flipped = X[..., :half], X[..., ::-1][..., :half]
    np.add(first, flipped, out=even)
    np.subtract(first, flipped, out=odd)
    out *= ROOT
    if n % 2:
        even[..., -1] *= ROOT
    return out


def join(Y: Rows, n: int) -> Rows:
    """Return the rows of length n that `split` takes apart."""
    half = (n + 1) // 2
    X = np.empty((*Y.shape[:-1], n))
    even, odd = Y[..., :half], Y[..., half:]
    np.subtract(even, odd, out=X[..., ::-1][..., :half])
    np.add(even, odd, out=X[..., :half])
    X *= ROOT
    if n % 2:
        X[..., half - 1] /= ROOT
    return X


class Halves:
    """A M on both parts, for products of any kind.

    Parameters
    ----------
    A, M : operator of shape (n, n)
        Real matrices that commute with the flip of a vector.

    Attributes
    ----------
    A : operator for `gmres`
        A M, on both parts.
    """

    def __init__(self, A: LinearOperator, M: LinearOperator) -> None:
        self._n = n = A.shape[0]
        self._A, self._M = A, M
        self.A = Multiplication(n + n % 2, A.dtype, self._multiply)

    def transform(self, X: Rows) -> Rows:
        """Return both parts of rows."""
        return split(X)

    def transform_back(self, Y: Rows) -> Rows:
        """Return M times the rows of which these are both parts."""
        X = join(Y, self._n)
        return self._M.apply(X, out=X)

    def _multiply(self, Y: Rows, out: Rows) -> Rows:
        X = self.transform_back(Y)
        return split(self._A.apply(X, out=X), out)


class TransformedHalves:
    """A M on both parts, in the domain where M, a circulant, is a diagonal.

    Half the circulant and half the skew-circulant whose sum A is (see `FourierForm`) are diagonals
    too, after the DCT-II and the DST-IV of even parts, and the DST-II and the DCT-IV of odd ones:
    a product takes eight transforms of half the length.

    Parameters
    ----------
    c : ndarray of shape (n,), float64
        First column, with n even.
    eigenvalues : ndarray of shape (n/2 + 1,), float64
        Those of M⁻¹, at θ = 2πk/n.

    Attributes
    ----------
    A : operator for `gmres`
        A M, in that domain.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an eigenvalue is zero.
    """

    def __init__(self, c: Array, eigenvalues: Array) -> None:
        require_nonzero(eigenvalues, c.dtype, "the circulant has the eigenvalue", "gmres")
        self._n = n = len(c)
        self._half = half = n // 2
        behind = np.concatenate([np.zeros(1), c[:0:-1]])  # The lags k - n.
        count_transforms(3, n)  # A complex one is two.
        ahead = transforms().rfft(0.5 * (c + behind)).real
        twisted = np.fft.fft(0.5 * (c - behind) * phase_factors(n, 0.5, np.dtype(np.complex128)))
        self._inverse = _of_both(1.0 / eigenvalues)
        self._circulant, self._skew = self._inverse * _of_both(ahead), twisted.real[:half].copy()
        self.A = Multiplication(n, c.dtype, self._multiply)

    def transform(self, X: Rows) -> Rows:
        """Return rows in that domain."""
        Y = split(X)
        self._transform(Y, 2)
        return Y

    def transform_back(self, Y: Rows) -> Rows:
        """Return M times the rows that rows in that domain stand for."""
        Y = Y * self._inverse
        self._transform(Y, 3)
        return join(Y, self._n)

    def _transform(self, Y: Rows, kind: int) -> None:
        """Transform both parts, in place."""
        dct, dst, *_ = transforms()
        count_transforms(Y.size // self._n, self._n)
        even, odd = Y[..., : self._half], Y[..., self._half :]
        dct(even, even, kind)
        dst(odd, odd, kind)

    def _multiply(self, Y: Rows, out: Rows) -> Rows:
        dct, dst, *_ = transforms()
        diagonal = self._circulant * Y
        np.multiply(self._inverse, Y, out=out)
        self._transform(out, 3)
        for transform, part in ((dst, out[..., : self._half]), (dct, out[..., self._half :])):
            transform(part, part, 4)
            part *= self._skew
            transform(part, part, 4)
        count_transforms(2 * (Y.size // self._n), self._n)
        self._transform(out, 2)
        out += diagonal
        return out


def _of_both(eigenvalues: Array) -> Array:
    """Return eigenvalues at θ = 2πk/n, k ≤ n/2, in the order of the transforms of both parts."""
    return np.concatenate([eigenvalues[:-1], eigenvalues[1:]])
