"""The inverse of a symmetric Toeplitz matrix whose coefficients end, in the domain of the DCT-II.

There the matrix is D + K, with samples of the symbol D. Of coefficients that are zero from some lag
on, or that decay so far, K is C H Cᵀ with a Hankel matrix H that has what the cosines see beyond
both ends. For an exponential, and for all autoregressive processes, moving averages and covariances
of Matérn's with half-integer smoothness, that has a rank of a few, and it is nearly so for
others that are smooth. So a few columns, of one even and of one odd frequency at a time, make K:
those where the diagonal of what is left of it is largest beside D. Then D + K is inverted by the
formula of Sherman, Morrison and Woodbury.

References
----------
M. Bebendorf, Approximation of boundary element matrices, Numer. Math. 86 (2000), for a matrix from
some of its rows and columns; H. Harbrecht, M. Peters, R. Schneider, On the low-rank approximation
by the pivoted Cholesky decomposition, Appl. Numer. Math. 62 (2012), for the choice of these.
"""

import numpy as np

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.row_sums import PART
from toeplitz_mg.engine.vectors import add_combination, dots
from toeplitz_mg.preconditioners.positivity import is_positive
from toeplitz_mg.solvers.cosine_form import CosineForm, by_parity

LONG = 2048  # Fewest numbers where iterations that are saved take longer than the columns.
MOST = 12  # Most columns of each parity: each takes as long as a quarter of an iteration.
SMALL = 1e-6  # Diagonal of what is left of K, over D, with which two iterations reach 1e-12.


class LowRankInverse:
    """The inverse of D + K for a `CosineForm`, with K from some of its columns.

    Attributes
    ----------
    diagonal : ndarray of shape (m,)
        The inverse of D.
    rank : int
        Columns of each parity, one at least.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it is not positive definite.
    """

    def __init__(self, form: CosineForm) -> None:
        D = form.samples[:-1]
        if not is_positive(D, np.float64):
            raise np.linalg.LinAlgError("a sample of the symbol is not positive")
        self.diagonal = d = np.reciprocal(D)
        of_both = by_parity(d)
        U, pivots = _cross(form, by_parity(form.diagonal - D), of_both)
        self.rank = len(U)
        of_both = U * of_both
        # Rows for both parities, each with zeros at the frequencies of the other.
        V = np.zeros((2, self.rank, form.m))
        V[0, :, ::2], V[1, :, 1::2] = of_both[:, 0], of_both[:, 1, : form.m // 2]
        W = np.zeros((2, self.rank, 2, self.rank))
        W[0, :, 0], W[1, :, 1] = _invert(U, of_both, pivots)
        self._V, self._W = V.reshape(-1, form.m), W.reshape(2 * self.rank, 2 * self.rank)

    def apply(self, R: Rows, out: Rows) -> None:
        """Multiply rows by it."""
        np.multiply(R, self.diagonal, out=out)
        m = len(self.diagonal)
        for r, z in zip(R.reshape(-1, m), out.reshape(-1, m), strict=True):
            add_combination(self._W.dot(dots(self._V, r)), self._V, z)


def has_low_rank(form: CosineForm) -> bool:
    """Whether K is nearly of low rank, and worth it.

    Of a vector in the middle of a longer one the inverse is a block of another one.
    """
    return form.has_ended and not form.has_zero and form.m == form.n >= LONG


def _cross(form: CosineForm, left: Array, d: Array) -> tuple[Array, Array]:
    """Return U and pivots p with K ≈ Σ u uᵀ/p, of even frequencies and of odd ones.

    Parameters
    ----------
    form : CosineForm
    left : ndarray of shape (2, half)
        The diagonal of K, which is changed.
    d : ndarray of shape (2, half)
        The inverse of D; zero where there is no frequency.

    Returns
    -------
    U : ndarray of shape (rank, 2, half)
    pivots : ndarray of shape (rank, 2)
    """
    U, pivots = np.empty((MOST, *left.shape)), np.ones((MOST, 2))
    for rank in range(MOST):
        sizes = np.abs(left)
        sizes *= d
        at = sizes.argmax(axis=1)
        here = np.arange(2), at
        is_large = sizes[here] > SMALL
        if rank and not is_large.any():
            return U[:rank], pivots[:rank]
        u = U[rank]
        u[...] = form.columns(at)
        if rank:
            before = U[:rank]
            u -= np.einsum("kp,kpj->pj", before[:, *here] / pivots[:rank], before)
        u[here] = left[here]
        if is_large.all():
            pivots[rank] = u[here]
        else:  # One parity has columns enough.
            u[~is_large] = 0.0
            pivots[rank, is_large] = u[here][is_large]
        left -= u**2 / pivots[rank, :, np.newaxis]
    return U, pivots


def _invert(U: Array, V: Array, pivots: Array) -> Array:
    """Return W with (D + Σ u uᵀ/p)⁻¹ = D⁻¹ + Vᵀ W V, where V is U D⁻¹, shape (2, rank, rank).

    Raises LinAlgError where that is not positive definite: by the inertia of the Schur complements
    of [[D, U], [Uᵀ, -P]], where -W⁻¹ has not as many negative eigenvalues as there are such pivots.
    """
    inner = np.zeros((2, len(U), len(U)))
    rows, columns = U.swapaxes(0, 1)[:, :, np.newaxis], V.swapaxes(0, 1)[:, np.newaxis]
    for k in range(0, U.shape[-1], PART):  # So short that BLAS has one thread.
        inner += np.vecdot(rows[..., k : k + PART], columns[..., k : k + PART])
    inner.reshape(2, -1)[:, :: len(U) + 1] += pivots.T
    eigenvalues, Q = np.linalg.eigh(inner)
    if np.count_nonzero(eigenvalues < 0.0) != np.count_nonzero(pivots < 0.0):
        raise np.linalg.LinAlgError("the approximate inverse is not positive definite")
    return -(Q / eigenvalues[:, np.newaxis]) @ Q.swapaxes(1, 2)
