"""Richardson iteration with a preconditioner: the paper's solver, with SciPy's signature."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.checks import check_system
from toeplitz_mg.solvers.iterate import Iterate

PATIENCE = 100  # Iterations without a smaller residual, after which none is expected.


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
    """Solve A x = b by x ← x + M (b - A x) (paper, Eq. 11).

    With ``M=fft_rsm_preconditioner(A)`` it is the paper's FFT+RSM solver (§5.3), with
    ``M=multigrid(A)`` the multigrid solver (§5.2).

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
    b : array_like of shape (n,) or (n, 1)
    x0 : array_like of shape (n,) or (n, 1), optional
        First guess, zero by default. It is not changed. One beside whose residual b underflows is
        not taken.
    rtol, atol : float
        It has converged where ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol).
    maxiter : int, optional
        Most iterations, 10 n by default.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`. The iteration converges where ρ(I - M A) < 1; it need not be
        symmetric.
    callback : callable, optional
        Called as ``callback(xk)`` with the iterate after each iteration. The array is used again:
        copy what is to be kept.
    residuals : list, optional
        It is filled with ‖b - A x‖₂ of the first guess and after each iteration, so that there are
        ``len(residuals) - 1`` iterations. What was in it is lost.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 where it has converged. Otherwise the iterations done (at least 1): they are used up, or
        the iteration diverges (the residual is not finite or has grown by 1/eps), or it stagnates
        (no smaller residual in 100 iterations). `x` is then the last iterate.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, negative tolerances, or
        `maxiter` below 1.
    TypeError
        For `b` or `x0` that are not of numbers, a `maxiter` that is no integer, or `residuals`
        that are no list.

    See Also
    --------
    cg, gmres

    Notes
    -----
    The residual is the true one in every iteration, and serves the stopping test as well as the
    next correction: one product with `A` and one with `M` an iteration. From a zero guess the
    first residual is `b` and costs none.

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
    system = check_system(A, b, x0, M, rtol, atol, maxiter, residuals, callback)
    state = Iterate(system)
    if state.size_of_b == 0.0:
        return state.zero()
    M = system.M
    goal, residual = state.goal(rtol, atol), state.vectors.norm(state.r)
    limit = max(residual, state.size_of_b) / np.finfo(system.dtype).eps
    best, best_at = residual, 0
    state.record(residual)
    while not residual <= goal:
        stagnates = state.iterations - best_at >= PATIENCE
        if state.iterations == system.maxiter or stagnates or not residual <= limit:
            return state.x, max(state.iterations, 1)
        with np.errstate(over="ignore", invalid="ignore"):  # It is reported, not warned of.
            r = state.r if M is None else apply_to_rows(M, state.r, state.r)
            r *= state.scale
            state.x += r
        residual = state.compute_residual()
        state.iterations += 1
        state.record(residual)
        if residual < best:
            best, best_at = residual, state.iterations
        if callback is not None:
            callback(state.x)
    return state.x, 0
