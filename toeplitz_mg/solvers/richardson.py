"""Richardson iteration with a preconditioner: the paper's solver, with SciPy's signature."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.checks import Iterate, check_system

PATIENCE = 100  # The iteration stops after this many iterations without a smaller residual.


def richardson(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | None = None,
    *,
    rtol: float = 1e-5,
    atol: float = 0.0,
    maxiter: int | None = None,
    M: Any = None,
    callback: Callable[[Array], object] | None = None,
    residuals: list[float] | None = None,
) -> tuple[Array, int]:
    """Solve A x = b by Richardson's iteration, x ← x + M (b - A x) (paper, Eq. 11).

    With ``M=fft_rsm_preconditioner(A)`` it is the paper's FFT+RSM solver (§5.3), with
    ``M=multigrid(A)`` the multigrid solver (§5.2).

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
    b, x0, rtol, atol, callback
        As for `cg`.
    maxiter : int, optional
        Maximum number of iterations, by default 10 n.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`; it need not be symmetric. The iteration converges for every
        right-hand side if ρ(I - M A) < 1.
    residuals : list, optional
        Its contents are replaced by ‖b - A x‖₂ of the initial guess and after each iteration.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 if the iteration has converged, otherwise the number of iterations (at least 1). Reasons:
        `maxiter` is reached; the iteration diverges (the residual is not finite or has grown by
        1/eps) or stagnates (no smaller residual in 100 iterations). `x` is then the last iterate.

    Raises
    ------
    ValueError, TypeError
        As for `cg`.

    See Also
    --------
    cg, gmres

    Notes
    -----
    An iteration takes one product with `A` and one with `M`: the true residual serves both the
    stopping test and the next correction. With a zero guess the first residual is `b`.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> problem = tmg.contact.problems.test1(1024)
    >>> M = tmg.multigrid(problem.A, pre=0, post=1)
    >>> residuals = []
    >>> x, info = tmg.richardson(problem.A, problem.b, M=M, rtol=1e-8, residuals=residuals)
    >>> info, len(residuals) - 1 < 20, residuals[-1] <= 1e-8 * residuals[0]
    (0, True, True)
    """
    state = _Correction(check_system(A, b, x0, M, rtol, atol, maxiter, residuals, callback))
    if state.size_of_b == 0.0:
        return state.zero()
    limit = max(state.size, state.size_of_b) / np.finfo(state.system.dtype).eps
    best, best_at, tell = state.size, 0, ranks_of(A).share_errors(callback)

    def watch() -> bool:
        nonlocal best, best_at
        if tell is not None:
            tell(state.x)
        if state.size < best:
            best, best_at = state.size, state.iterations
        return state.iterations - best_at >= PATIENCE or not state.size <= limit

    converged = state.reach(state.goal(rtol, atol), state.system.maxiter, watch)
    return state.x, 0 if converged else max(state.iterations, 1)


class _Correction(Iterate):
    """Corrections of x by M r."""

    def advance(self, goal: float) -> bool:
        """Correct x, and compute the residual."""
        M = self.system.M
        with np.errstate(over="ignore", invalid="ignore"):  # `info` reports overflow.
            r = self.r if M is None else apply_to_rows(M, self.r, self.r)
            r *= self.scale
            self.x += r
        self.compute_residual()
        return True
