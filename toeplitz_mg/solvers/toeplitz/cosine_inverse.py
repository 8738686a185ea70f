"""Approximate inverses of a symmetric Toeplitz matrix in the domain of the DCT-II.

There the matrix is D + K with samples D of the symbol. The entries of K change slowly with both
frequencies, except near the lowest ones, where the symbol may have zeros and poles.
`ApproximateInverse` inverts the block of the lowest frequencies exactly, and uses D for the others.

If the coefficients end or decay far enough, K is -C H Cᵀ with a Hankel matrix H of the lags that
reach beyond the ends. For exponentials, all autoregressive processes and Matérn covariances of
half-integer smoothness it has a rank of a few, and nearly so for a Gaussian. `LowRankInverse`
builds K from some of its columns, chosen by a pivoted elimination of its entries at some
frequencies. The Sherman-Morrison-Woodbury formula inverts D + K.

References
----------
M. Bebendorf, Approximation of boundary element matrices, Numer. Math. 86 (2000), for a matrix from
some of its rows and columns; H. Harbrecht, M. Peters, R. Schneider, On the low-rank approximation
by the pivoted Cholesky decomposition, Appl. Numer. Math. 62 (2012), for the choice of these.
"""

from contextlib import suppress
from functools import lru_cache

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.small_matrices import invert
from toeplitz_mg.engine.vectors import PART, add_combination, dots
from toeplitz_mg.operators.positivity import is_positive
from toeplitz_mg.solvers.toeplitz.cosine_form import ZERO, CosineForm, Points, choose_points
from toeplitz_mg.solvers.toeplitz.sizes import LOW_RANK

LOWEST = 32  # Lowest pairs of frequencies (an even and an odd one) that are inverted exactly.
MOST = 10  # Most columns of each parity.
# Numbers of candidate pairs of frequencies: next to an end, and from there to the middle.
NEAR = 18, 22
# Largest diagonal of the rest of K, relative to D, at the candidates. With it CG takes one to three
# iterations, but up to 13 for a Gaussian times a cosine, whose peak may lie between candidates.
SMALL = 1e-6


def precondition(form: CosineForm) -> "ApproximateInverse | LowRankInverse":
    """Return an approximate inverse: D plus a matrix of low rank if possible.

    Raises
    ------
    numpy.linalg.LinAlgError
        If it is not positive definite.
    """
    # If the symbol has a zero, D has no inverse. For a padded vector the inverse would be a block
    # of that of another matrix.
    if form.has_ended and not form.has_zero and form.m == form.n >= LOW_RANK:
        with suppress(np.linalg.LinAlgError):
            return LowRankInverse(form)
    return ApproximateInverse(form)


class ApproximateInverse:
    """The inverse of C A Cᵀ for the lowest frequencies, and of its diagonal for the others.

    Attributes
    ----------
    diagonal : ndarray of shape (m,)
        The inverse of the diagonal.
    of_lowest : ndarray of shape (2 k, 2 k)
        The inverse for the lowest frequencies.

    Raises
    ------
    numpy.linalg.LinAlgError
        If it is not positive definite.
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
            self.of_lowest[parity::2, parity::2] = invert(B[parity])

    def apply(self, R: Rows, out: Rows) -> None:
        """Multiply rows by the approximate inverse."""
        np.multiply(R, self.diagonal, out=out)
        lowest = np.s_[..., : len(self.of_lowest)]
        out[lowest] = R[lowest].dot(self.of_lowest)


def _diagonal(form: CosineForm, lowest: Array) -> Array:
    """Return D: the given lowest entries, and samples of the symbol at the other frequencies."""
    D = np.empty(form.m)
    D[: len(lowest)] = lowest
    others, f = D[len(lowest) :], form.samples[len(lowest) - 1 :]
    if form.has_ended and f[0] > ZERO * f.max():
        others[...] = f[1:-1]  # A differs from its symbol only by a matrix of low rank.
    else:
        # Cut-off lags add (-1)^k times a smooth function, which a mean of neighbours removes.
        np.multiply(f[1:-1], 2.0, out=others)
        others += f[:-2]
        others += f[2:]
        others *= 0.25
    return D


@lru_cache(maxsize=64)
def _lowest(m: int) -> Points:
    """Return the lowest frequencies of a transform of length m."""
    return choose_points(m, 2 * np.arange(min(LOWEST, m // 2)) + [[0], [1]])


class LowRankInverse:
    """The inverse of D + K for a `CosineForm`, with K built from some of its columns.

    Attributes
    ----------
    diagonal : ndarray of shape (m,)
        The inverse of D.
    ranks : tuple of int
        The numbers of columns with even and with odd frequencies.

    Raises
    ------
    numpy.linalg.LinAlgError
        If it is not positive definite, or the rank of K is too large.
    """

    def __init__(self, form: CosineForm) -> None:
        D = form.samples[:-1]
        if not is_positive(D, np.float64):
            raise np.linalg.LinAlgError("a sample of the symbol is not positive")
        self.diagonal = np.reciprocal(D)
        self._parts = []
        for parity, (frequencies, diagonal) in enumerate(_choose(form, D)):
            if len(frequencies):
                U, at = form.rows(frequencies), frequencies // 2
                U[np.arange(len(U)), at] = diagonal
                signs = _eliminate(U, at)
                V = U * self.diagonal[parity::2]
                self._parts.append((parity, V, _invert_small(signs, U, V)))

    @property
    def ranks(self) -> tuple[int, ...]:
        """The numbers of columns with even and with odd frequencies."""
        ranks = {parity: len(V) for parity, V, _ in self._parts}
        return ranks.get(0, 0), ranks.get(1, 0)

    def apply(self, R: Rows, out: Rows) -> None:
        """Multiply rows by the approximate inverse."""
        np.multiply(R, self.diagonal, out=out)
        m = len(self.diagonal)
        for r, z in zip(R.reshape(-1, m), out.reshape(-1, m), strict=True):
            for parity, V, W in self._parts:
                part = r[parity::2].copy()
                weights = W.dot(dots(V, part))
                part[...] = 0.0
                add_combination(weights, V, part)
                z[parity::2] -= part


def _choose(form: CosineForm, D: Array) -> list[tuple[Array, Array]]:
    """Return the even and the odd frequencies whose columns build K, with the diagonal of K there.

    K is eliminated at the candidate frequencies. The next pivot is where the diagonal of the rest
    is largest relative to D.
    """
    points = _candidates(form.m)
    found = []
    for K, frequencies in zip(form.entries(points), points.frequencies, strict=True):
        d = D[frequencies]
        rest = K.reshape(-1)[:: len(K) + 1]  # The diagonal of the rest of K.
        rest -= d
        diagonal, scale = rest.copy(), 1.0 / d
        chosen: list[int] = []
        sizes: list[float] = []
        while True:
            left = np.abs(rest) * scale
            at = int(left.argmax())
            sizes.append(float(left[at]))
            if sizes[-1] <= SMALL:
                break
            if len(chosen) == MOST:
                raise np.linalg.LinAlgError("the matrix is not a diagonal and one of low rank")
            chosen.append(at)
            row = K[at].copy()
            K -= (row / row[at])[:, np.newaxis] * row
        found.append((frequencies[chosen], diagonal[chosen]))
    return found


@lru_cache(maxsize=64)
def _candidates(m: int) -> Points:
    """Return the candidate frequencies for the elimination of K, denser near both ends."""
    pairs = m // 2
    steps = _steps(pairs // 2, *NEAR)
    numbers = np.unique(np.append(steps, pairs - 1 - steps))
    return choose_points(m, 2 * numbers + [[0], [1]])


def _steps(end: int, first: int, others: int) -> Array:
    """Return the `first` numbers from 0 on, and `others` at growing distances up to `end`."""
    first = min(first, end)
    return np.append(np.arange(first), np.geomspace(first, end, others).round().astype(int))


def _eliminate(U: Array, at: Array) -> Array:
    """Replace rows of K, in place, by a U with K = Uᵀ S U, and return the signs in S.

    Each row becomes the rest that the previous ones leave of it. The last ones are as small as the
    rounding errors of the first, so the inverse of the entries of K at all pivots would be
    inaccurate.
    """
    signs = np.empty(len(U))
    for k, j in enumerate(at.tolist()):
        add_combination(-signs[:k] * U[:k, j], U[:k], U[k])
        if U[k, j] == 0.0:
            raise np.linalg.LinAlgError("a pivot is zero")
        signs[k] = np.sign(U[k, j])
        U[k] /= np.sqrt(abs(U[k, j]))
    return signs


def _invert_small(signs: Array, U: Array, V: Array) -> Array:
    """Return W with (D + Uᵀ S U)⁻¹ = D⁻¹ - Vᵀ W V, where V = U D⁻¹ and S has these signs.

    W⁻¹ is S + U D⁻¹ Uᵀ. By the inertia of the Schur complements of [[D, Uᵀ], [U, -S]], D + Uᵀ S U
    is positive definite if W⁻¹ has as many negative eigenvalues as S. Otherwise a LinAlgError is
    raised.
    """
    inner = np.diag(signs)
    for k in range(0, U.shape[-1], PART):  # So short that BLAS uses one thread.
        inner += np.vecdot(U[:, np.newaxis, k : k + PART], V[:, k : k + PART])
    eigenvalues, Q = np.linalg.eigh((inner + inner.T) / 2.0)
    if not eigenvalues.all() or np.count_nonzero(eigenvalues < 0.0) != np.count_nonzero(signs < 0):
        raise np.linalg.LinAlgError("the approximate inverse is not positive definite")
    return (Q / eigenvalues) @ Q.T
