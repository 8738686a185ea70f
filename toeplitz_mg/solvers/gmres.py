"""GMRES, preconditioned from the right, so that the true residual is what stops it."""

from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.engine.krylov_space import KrylovSpace
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.base import require_numpy, require_serial
from toeplitz_mg.solvers.checks import System, check_precision, check_system
from toeplitz_mg.solvers.iterate import Iterate
from toeplitz_mg.values import count

RESTART = 20  # Most iterations of a cycle, as in SciPy: there are 28 vectors then.
STAGNANT = 0.999  # Factor by which some cycles are to reduce the residual, for another to follow.
PATIENCE = 10  # So many cycles: one alone may gain next to nothing, and those after it much.


def gmres(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | None = None,
    *,
    rtol: float = 1e-5,
    atol: float = 0.0,
    restart: int | None = None,
    maxiter: int | None = None,
    M: Any = None,
    callback: Callable[[Any], object] | None = None,
    callback_type: str | None = None,
    residuals: list[float] | None = None,
) -> tuple[Array, int]:
    """Solve A x = b by GMRES, for any matrix, as `scipy.sparse.linalg.gmres` does.

    SciPy preconditions from the left, and so makes the residual least after the multiplication
    with `M`. Here it is ‖b - A x‖₂ itself that is made least, in each iteration, and that says
    when to stop.

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
        Real or complex, symmetric or not.
    b : array_like of shape (n,) or (n, 1)
    x0 : array_like of shape (n,) or (n, 1), optional
        First guess, zero by default. It is not changed. One beside whose residual b underflows is
        not taken.
    rtol, atol : float
        It has converged where ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol). A recurrence tells that norm in
        each iteration; at the end of a cycle it is computed, and only that decides.
    restart : int, optional
        Most iterations of a cycle, ``min(20, n)`` by default, after which the next one starts from
        the residual. It keeps ``restart + 1`` vectors, and at most seven beside them: by default
        28, of 224 MiB in 2^20 real unknowns.
    maxiter : int, optional
        Most cycles, 10 n by default.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`, that need not be symmetric. It may be in less precision.
    callback : callable, optional
        What it is called with, `callback_type` has to say.
    callback_type : {"x", "pr_norm"}, optional
        With "x" it is ``callback(xk)`` with the iterate after each cycle; with "pr_norm"
        ``callback(norm)`` with ‖b - A x‖₂/‖b‖₂ after each iteration.
    residuals : list, optional
        It is filled with ‖b - A x‖₂ of the first guess and after each iteration, so that there are
        ``len(residuals) - 1`` iterations. What was in it is lost. The norms are those of the
        recurrence, but for those that are computed: the first one, and the last one of each cycle.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 where it has converged. Otherwise the iterations done, of all cycles (at least 1): the
        cycles are used up; or a cycle has not reduced the residual, or ten cycles by less than
        0.1 % together, as with a singular matrix, near rounding, or with too short a cycle; or `A`
        or `M` is found not to be finite. `x` is then the iterate of the least residual.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, negative tolerances, `restart`
        or `maxiter` below 1, or a `callback` of another type than these two.
    TypeError
        For what is not of numbers, or not in single or double precision, a `restart` or `maxiter`
        that is no integer, or `residuals` that are no list.

    See Also
    --------
    cg : for a symmetric or Hermitian positive definite matrix, in less memory
    richardson

    Notes
    -----
    An iteration takes one product with `A` and one with `M`, and makes a vector orthogonal to all
    others of the cycle. A cycle takes one product more with each of the two.

    References
    ----------
    Y. Saad, M. H. Schultz, GMRES: a generalized minimal residual algorithm for solving
    nonsymmetric linear systems, SIAM J. Sci. Stat. Comput. 7 (1986).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> k = np.arange(1000)
    >>> A = tmg.ToeplitzOperator((1.0 + k) ** -1.1, 0.5 * (1.0 + k) ** -2.0)
    >>> residuals = []
    >>> x, info = tmg.gmres(A, np.ones(1000), residuals=residuals)
    >>> info, len(residuals) - 1 <= 20, residuals[-1] <= 1e-5 * residuals[0]
    (0, True, True)
    """
    require_serial("A", A)
    require_numpy(A, "gmres")
    system = check_system(A, b, x0, M, rtol, atol, maxiter, residuals, callback)
    dtype, n = check_precision(system), len(system.b)
    restart = min(n, RESTART if restart is None else count("restart", restart))
    allowed = ("x", "pr_norm") if callback else ("x", "pr_norm", None)
    if not isinstance(callback_type, str | None) or callback_type not in allowed:
        raise ValueError(
            f"callback_type is {callback_type!r}, but must be 'x', to call back with the iterate "
            "after each cycle, or 'pr_norm', with the relative residual after each iteration"
        )
    reports_norms = callback_type == "pr_norm"
    state = Iterate(system)
    if state.size_of_b == 0.0:
        return state.zero()
    goal, residual = state.goal(rtol, atol), norm(state.r)
    state.record(residual)
    space = KrylovSpace(_product(system), (n,), dtype, restart)
    cycles, past = 0, deque([np.inf] * PATIENCE, PATIENCE)
    while not residual <= goal:
        has_gained = residual < past[-1] and residual < STAGNANT * past[0]
        if cycles == system.maxiter or not has_gained:
            return state.x, max(state.iterations, 1)
        before = residual
        past.append(before)
        with np.errstate(over="ignore", invalid="ignore"):  # It is told by `info`.
            least = before
            for least in _extend(space, state.r, restart, goal):
                state.iterations += 1
                state.record(least)
                if callback is not None and reports_norms and least > goal:
                    callback(least / state.size_of_b)
            residual = _correct(state, space, system.M, before)
        cycles += 1
        state.record(residual)
        if callback is not None and reports_norms and least <= goal:  # It is told once it is known.
            callback(residual / state.size_of_b)
        if callback is not None and callback_type == "x":
            callback(state.x)
    return state.x, 0


def gmres_by_recurrence(
    A: LinearOperator,
    b: Array,
    *,
    M: LinearOperator | None,
    rtol: float,
    most: int,
    residuals: list[float],
    callback: Callable[[float], object],
) -> tuple[Array, bool]:
    """Return what `gmres` finds in one cycle by the recurrence alone, and whether it converged.

    It is for those who compute the residual of the result themselves, and correct it. The callback
    is called with ‖b - A x‖₂/‖b‖₂ after each iteration.
    """
    system = check_system(A, b, None, M, rtol, 0.0, 1, residuals)
    state = Iterate(system)
    if state.size_of_b == 0.0:
        return state.x, True
    goal, least = state.goal(rtol, 0.0), state.size_of_b
    state.record(least)
    space = KrylovSpace(_product(system), b.shape, check_precision(system), most)
    for least in _extend(space, state.r, most, goal):
        state.iterations += 1
        state.record(least)
        callback(least / state.size_of_b)
    return _find(state, space, M), least <= goal


def _product(system: System) -> Multiply:
    """Return the products with A M, or with A."""
    A, M = system.A, system.M
    if M is None:
        return partial(apply_to_rows, A)
    between = np.empty(len(system.b), system.dtype)
    return lambda v, out: apply_to_rows(A, apply_to_rows(M, v, between), out)


def _extend(space: KrylovSpace, r: Array, most: int, goal: float) -> Iterator[float]:
    """Search a space that grows until it holds a solution, and yield the least residuals."""
    space.begin(r)
    while space.dimension < most:
        least = space.extend()
        yield least
        if least <= goal:  # It is 0 where nothing more is to be had.
            return


def _correct(state: Iterate, space: KrylovSpace, M: LinearOperator | None, before: float) -> float:
    """Add to x the best in the space, if it is better, and return the norm of the residual."""
    x = state.x
    state.x = x + _find(state, space, M)
    residual = state.compute_residual()
    if residual < before:
        return residual
    state.x = x
    return before


def _find(state: Iterate, space: KrylovSpace, M: LinearOperator | None) -> Array:
    """Return the best change of x in the space."""
    z = space.solution()
    if M is not None:
        apply_to_rows(M, z, z)
    z *= state.scale
    return z
