"""Fine unknowns that no coarse element covers, solved together with the coarse grid."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.positivity import rounding

# Most leftover unknowns for which a border is built: each takes a product and a coarse solution at
# set-up, and two vectors. A fragmented mask may leave more; then only the smoother acts on them.
MOST_LEFTOVER = 16


@dataclass(frozen=True)
class Border:
    """The Galerkin correction on the coarse elements *and* the leftover unknowns.

    On a line of odd length, a coarse correction without the last element has the wrong sign there,
    and no smoother repairs that quickly. So the coarse space is enlarged by vectors u_j, such as
    the unit vectors of the leftover unknowns. With V_j = R A u_j, the matrix on the enlarged space
    is

        [ A_H    V ]
        [ s Vᵀ   C ],     C_ij = u_iᵀ A u_j,     Pᵀ = s R,

    It has a Toeplitz block and a border of few rows, which is eliminated. With the coarse cycle B ≈
    A_H⁻¹ and the stored W = B V, a correction costs one coarse cycle and O(n) operations. It is
    symmetric positive definite if B is, and if B ≤ A_H⁻¹.

    Attributes
    ----------
    unknowns : ndarray of int, of shape (p, q)
    weights : ndarray of shape (q,)
        The entries of u_j at ``unknowns[j]``.
    V, W : ndarray of shape (p, n_H)
        The vectors V_j and W_j, stored as rows.
    S_inverse : ndarray of shape (p, p)
        The inverse of C - s Vᵀ W.
    s : float
        The number with Pᵀ = s R.
    """

    unknowns: Array
    weights: Array
    V: Array
    W: Array
    S_inverse: Array
    s: float

    @classmethod
    def of(
        cls, A: LinearOperator, transfer: Transfer, solve_coarse: Callable[[Array], Array]
    ) -> "Border | None":
        """Return the border of a grid, or None if there is none or too long a one.

        It is also None if S = C - s Vᵀ W is not positive definite, which can happen if the coarse
        matrix is not R A P: with that border the correction would be indefinite.
        """
        if not 0 < len(transfer.leftover) <= MOST_LEFTOVER:
            return None
        unknowns, weights = transfer.border_vectors
        weights = weights.astype(A.dtype)
        U = np.zeros((len(unknowns), A.shape[0]), dtype=A.dtype)
        U[np.arange(len(unknowns))[:, np.newaxis], unknowns] = weights
        columns = apply_to_rows(A, U)
        V = transfer.restrict(columns).copy()
        W = solve_coarse(V).copy()
        s = transfer.scale
        C = columns[:, unknowns] @ weights
        S = C - s * V @ W.T
        if not np.linalg.eigvalsh((S + S.T) / 2)[0] > rounding(C, S.dtype):
            return None
        return cls(unknowns, weights, V, W, np.linalg.inv(S), s)

    def correct(self, e: Array, r: Array) -> tuple[Array, Array]:
        """Eliminate the border: from e = B R r return the coarse correction and factors of u."""
        left = (r[..., self.unknowns] @ self.weights - self.s * e @ self.V.T) @ self.S_inverse.T
        return e - left @ self.W, left

    def add(self, left: Array, correction: Array) -> None:
        """Add the vectors u times the factors `left` to a correction."""
        for factor, unknowns in zip(np.moveaxis(left, -1, 0), self.unknowns, strict=True):
            correction[..., unknowns] += factor[..., np.newaxis] * self.weights
