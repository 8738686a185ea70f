"""GMRES as a method of `solve_toeplitz`: how far it must have come, or else it is given up."""

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.solvers.gmres import gmres

MOST = 30  # Most iterations, and so vectors: 240 MiB in 2^20 real unknowns.
# ‖b - A x‖/‖b‖ that is to be reached after so many iterations. Where it is not, what follows, an
# exact inverse or Levinson's recursion, is sooner there.
EXPECTED = {10: 1e-2, 20: 1e-5}
USEFUL = 1e-6  # ‖b - A x‖/‖b‖ at which rounding may have stopped it: the caller corrects that.


class _TooSlow(Exception):
    """GMRES converges too slowly."""


def solve_by_gmres(A: LinearOperator, M: LinearOperator, B: Rows, rtol: float) -> tuple[Rows, int]:
    """Solve for each row of B, and return the most iterations of all.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where it converges too slowly for any of them.
    """
    X = np.empty_like(B)
    most = 0
    for x, b in zip(np.atleast_2d(X), np.atleast_2d(B), strict=True):
        x[:], iterations = _solve(A, M, b, rtol)
        most = max(most, iterations)
    return X, most


def _solve(A: LinearOperator, M: LinearOperator, b: Array, rtol: float) -> tuple[Array, int]:
    residuals: list[float] = []

    def give_up(relative: float) -> None:
        if relative > EXPECTED.get(len(residuals) - 1, np.inf):
            raise _TooSlow

    try:
        x, info = gmres(
            A,
            b,
            M=M,
            rtol=rtol,
            restart=MOST,
            maxiter=1,
            callback=give_up,
            callback_type="pr_norm",
            residuals=residuals,
        )
    except _TooSlow:
        info = 1
    iterations = len(residuals) - 1
    if info > 0 and not residuals[-1] <= USEFUL * residuals[0]:
        raise np.linalg.LinAlgError(
            f"gmres has reached {residuals[-1] / residuals[0]:.1e} ‖b‖ in {iterations} iterations"
        )
    return x, iterations
