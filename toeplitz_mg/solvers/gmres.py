"""GMRES, preconditioned from the right, so that the stopping test uses the true residual."""

import warnings
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.engine.krylov_space import KrylovSpace
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.base import library_for, require_serial
from toeplitz_mg.solvers.checks import Iterate, System, check_precision, check_system
from toeplitz_mg.values import count

RESTART = 20  # Default number of iterations in a cycle, as in SciPy; 28 vectors are stored.
STAGNANT = 0.999  # Another cycle is made if PATIENCE cycles reduced the residual by this factor.
TYPES = "x", "pr_norm", "legacy", None  # Values of `callback_type`.
PATIENCE = 10  # Cycles compared: a single one may gain almost nothing, and later ones much.


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
    """Solve A x = b by GMRES, for any square matrix.

    Same arguments as `scipy.sparse.linalg.gmres`. SciPy preconditions from the left and minimises
    the norm of the preconditioned residual. Here the preconditioner acts from the right: each
    iteration minimises ‖b - A x‖₂ itself, which is also what the tolerance refers to.

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
        Real or complex, symmetric or not.
    b, x0, rtol, atol
        As for `cg`.
    restart : int, optional
        Number of iterations in a cycle, by default ``min(20, n)``, after which the iteration is
        restarted from the residual. ``restart + 1`` vectors are stored, and at most seven others:
        by default 28, which are 224 MiB for 2^20 real unknowns.
    maxiter : int, optional
        Maximum number of cycles, by default 10 n; with a "legacy" callback, of iterations.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`; it need not be symmetric and may have lower precision.
    callback : callable, optional
    callback_type : {"x", "pr_norm", "legacy"}, optional
        "x": ``callback(xk)`` is called with the iterate after each cycle. "pr_norm":
        ``callback(norm)`` is called with ‖b - A x‖₂/‖b‖₂ after each iteration. "legacy" does the
        same, and `maxiter` then counts iterations; this is SciPy's default, with a warning.
    residuals : list, optional
        As for `cg`; the norm at the end of each cycle is that of the true residual.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 if the iteration has converged, otherwise the number of cycles or iterations, as `maxiter`
        counts them (at least 1). Reasons: `maxiter` is reached; a cycle has not reduced the
        residual, or ten cycles together by less than 0.1 % (a singular matrix, rounding errors, or
        a small `restart`); `A` or `M` is found not to be finite. `x` is then the iterate with the
        smallest residual.

    Raises
    ------
    ValueError, TypeError
        As for `cg`, and if `restart` is below 1 or `callback_type` is unknown.

    See Also
    --------
    cg : for Hermitian positive definite matrices; needs less memory.
    richardson : the stationary iteration with the same preconditioner.

    Notes
    -----
    An iteration takes one product with `A` and one with `M`, and orthogonalises a vector against
    all others of the cycle. Each cycle takes one more product with each of the two.

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
    system = check_system(A, b, x0, M, rtol, atol, maxiter, residuals, callback)
    restart = min(system.b.shape[0], RESTART if restart is None else count("restart", restart))
    by_iterations = _counts_iterations(callback, callback_type)
    state = Space(system, restart)
    if state.size_of_b == 0.0:
        return state.zero()
    goal, done, past = state.goal(rtol, atol), 0, deque([np.inf] * PATIENCE, PATIENCE)

    def tell() -> None:
        if callback is not None and callback_type != "x":
            callback(np.float64(state.size / state.size_of_b))

    def watch() -> None:
        if state.size > goal:  # The last iteration is reported when its true residual is known.
            tell()

    while not state.size <= goal:
        has_gained = state.size < past[-1] and state.size < STAGNANT * past[0]
        if done == system.maxiter or not has_gained:
            return state.x, max(done, 1)
        past.append(state.size)
        before = state.iterations
        length = min(restart, system.maxiter - done) if by_iterations else restart
        is_last = state.reach(goal, before + length, watch)
        state.correct()
        done += state.iterations - before if by_iterations else 1
        if is_last:
            tell()
        if callback is not None and callback_type == "x":
            callback(state.x)
    return state.x, 0


def _counts_iterations(callback: Any, callback_type: Any) -> bool:
    """Whether `maxiter` counts iterations instead of cycles; refuse unknown callback types."""
    if callback_type is None and callback is not None:
        warnings.warn(
            "gmres is called without specifying `callback_type`, which is then 'legacy' as in "
            "SciPy: maxiter counts iterations. Give callback_type='legacy', or 'pr_norm' for the "
            "same callback and a maxiter that counts cycles",
            DeprecationWarning,
            stacklevel=3,
        )
        return True
    if not isinstance(callback_type, str | None) or callback_type not in TYPES:
        raise ValueError(
            f"callback_type is {callback_type!r}, but must be 'x', to call back with the iterate "
            "after each cycle, 'pr_norm', with the relative residual after each iteration, or "
            "'legacy', like 'pr_norm' but with a maxiter that counts iterations"
        )
    return callback is not None and callback_type == "legacy"


class Space(Iterate):
    """GMRES: the iterate with the smallest residual in a Krylov space of A M."""

    def __init__(self, system: System, restart: int | None = None) -> None:
        dtype, n = check_precision(system), system.b.shape[0]
        super().__init__(system)
        most = min(n, system.maxiter if restart is None else restart)
        basis = library_for(system.A).basis(system.b, dtype, most)
        self._space = KrylovSpace(_product(system), basis)
        self._before = self.size

    def begin(self) -> None:
        """Start a Krylov space with the residual."""
        self._before = self.size
        self._space.begin(self.r)

    def advance(self, goal: float) -> bool:
        """Add a dimension if there is room; the residual is 0 if the space is exhausted."""
        if self._space.dimension == self._space.most:
            return False
        with np.errstate(over="ignore", invalid="ignore"):  # `info` reports overflow.
            self.size = self._space.extend()
        return True

    def solution(self) -> Array:
        """Return the sum of x and the best correction in the space."""
        with np.errstate(over="ignore", invalid="ignore"):
            z = self._space.solution()
            if self.system.M is not None:
                z = apply_to_rows(self.system.M, z, z)
            return self.x + z * self.scale

    def correct(self) -> None:
        """Replace x by the solution, if that is better, and compute the residual."""
        x, self.x = self.x, self.solution()
        self.compute_residual()
        if not self.size < self._before:
            self.x, self.size = x, self._before
        self.record()


def _product(system: System) -> Multiply:
    """Return the function that multiplies by A M, or by A."""
    A, M = system.A, system.M
    if M is None:
        return partial(apply_to_rows, A)
    between = system.vectors.zeros(system.b, system.dtype)
    return lambda v, out: apply_to_rows(A, apply_to_rows(M, v, between), out)
