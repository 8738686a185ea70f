"""An approximate inverse of a symmetric Toeplitz matrix, in the domain of the DCT-II.

There the matrix is a diagonal, with samples of the symbol, and a matrix whose entries change
slowly with both frequencies, but near the lowest, where zeros and poles of the symbol are. So it is
inverted exactly for the lowest frequencies, and by the diagonal for the others.
"""

from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.preconditioners.positivity import is_positive
from toeplitz_mg.solvers.cosine_form import CosineForm, Points, choose_points

LOWEST = 32  # Lowest pairs of frequencies, an even and an odd one, that are inverted exactly.
# Sample of the symbol next to the lowest frequencies, over the largest, below which rounding says
# how many iterations it takes: (2 - 2 cos θ)² has that from some 6000 unknowns on.
LEAST = 1e-7


class ApproximateInverse:
    """The inverse of C A Cᵀ for the lowest frequencies, and of its diagonal for others.

    Attributes
    ----------
    diagonal : ndarray of shape (m,)
        The inverse of the diagonal.
    of_lowest : ndarray of shape (2 k, 2 k)
        The inverse for the lowest frequencies.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it is not positive definite.
    """

    def __init__(self, form: CosineForm) -> None:
        B = form.entries(_lowest(form.m))
        k = B.shape[-1]
        of_B = B.reshape(2, -1)[:, :: k + 1]
        D = _diagonal(form, of_B.T.ravel())
        if not is_positive(D, np.float64):
            raise np.linalg.LinAlgError("a sample of the symbol is not positive")
        self.diagonal = np.reciprocal(D)
        self.of_lowest = np.zeros((2 * k, 2 * k))
        for parity in (0, 1):
            self.of_lowest[parity::2, parity::2] = _invert(B[parity])

    def apply(self, R: Rows, out: Rows) -> None:
        """Multiply rows by it."""
        np.multiply(R, self.diagonal, out=out)
        lowest = np.s_[..., : len(self.of_lowest)]
        out[lowest] = R[lowest].dot(self.of_lowest)


def _diagonal(form: CosineForm, lowest: Array) -> Array:
    """Return D, whose first entries are given: samples of the symbol at the other frequencies."""
    D = np.empty(form.m)
    D[: len(lowest)] = lowest
    others, f = D[len(lowest) :], form.samples[len(lowest) - 1 :]
    if form.has_ended and f[0] > LEAST * f.max():
        others[...] = f[1:-1]  # A differs from its symbol by a matrix of small rank only.
    else:
        # Lags that are cut off add (-1)^k times something smooth: a mean of neighbours has not.
        np.multiply(f[1:-1], 2.0, out=others)
        others += f[:-2]
        others += f[2:]
        others *= 0.25
    return D


@lru_cache(maxsize=64)
def _lowest(m: int) -> Points:
    """Return the lowest frequencies of a transform of length m."""
    return choose_points(m, 2 * np.arange(min(LOWEST, m // 2)) + [[0], [1]])


def _invert(B: Array) -> Array:
    """Invert a symmetric positive definite matrix; raise LinAlgError where it is not."""
    factor, not_positive = dpotrf(B.T, overwrite_a=True)
    # Of `dpotri` OpenBLAS makes threads, which may wait for each other for a hundred milliseconds.
    inverse, singular = dtrtri(factor, overwrite_c=True)
    if not_positive or singular:
        raise np.linalg.LinAlgError("the matrix of the lowest frequencies is not positive definite")
    return inverse @ inverse.T
