"""Preconditioned conjugate gradients that allocate nothing in an iteration."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.algebra import is_hermitian
from toeplitz_mg.solvers.checks import Iterate, System, check_precision, check_system

RELIABLE = 1e-3  # Relative error of an `inner` residual that does not disturb the iteration.
# Factor by which ‖r‖ falls before an `inner` residual is computed anew: the first, and the largest,
# which is that of a rough residual. With a larger one it is computed too often.
MOST_FALL = 0.3
# What the recurrence is to reach in each start, over the goal, as it may drift from the residual:
# rounding that spoils the second start will spoil a third.
AIMS = (1.0, 0.5)


def cg(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | None = None,
    *,
    rtol: float = 1e-5,
    atol: float = 0.0,
    maxiter: int | None = None,
    M: Any = None,
    callback: Callable[[Array], object] | None = None,
    inner: Any = None,
    residuals: list[float] | None = None,
) -> tuple[Array, int]:
    """Solve A x = b by conjugate gradients, and check the true residual.

    Drop-in for `scipy.sparse.linalg.cg`, with the same iterates. It makes one product more than
    SciPy: the true residual, from which ``info = 0`` follows. Inner products neither over- nor
    underflow, however large or small `b` is, and no vectors are allocated in an iteration.

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
        Symmetric positive definite, or Hermitian positive definite.
    b : array_like of shape (n,) or (n, 1)
    x0 : array_like of shape (n,) or (n, 1), or "Mb", optional
        First guess, zero by default; "Mb" is ``M @ b``. It is not changed. A guess so large that
        `b` underflows beside its residual is not taken.
    rtol, atol : float
        It has converged where ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol). Where the recurrence for the
        residual is there, the true one is computed, in the precision of `A` and `b`; if that has
        drifted from it by rounding, the iteration starts once more from there.
    maxiter : int, optional
        Most iterations, 10 n by default.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`, symmetric or Hermitian positive definite, also in float32. An
        operator that is known not to be symmetric, as a V(0,1) cycle, is warned of.
    callback : callable, optional
        Called as ``callback(xk)`` with the iterate after each iteration. The array is used again:
        copy what is to be kept.
    inner : LinearOperator, optional
        `A` in less precision, as ``A.astype(np.float32)``, in which the iteration then is; the
        residual is computed anew with `A` whenever it may be wrong by 0.1 %, mostly two or three
        times. It pays for condition numbers of some thousands, and not above 1e6. `M` had best be
        in that precision too.
    residuals : list, optional
        It is filled with ‖b - A x‖₂ of the first guess and after each iteration, and loses what was
        in it. All but the first and the last are norms of the recurrence.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 where it has converged. Otherwise the iterations done (at least 1): they are used up; or
        `A` or `M` is found not to be positive definite, or not to be finite; or `A` is too
        ill-conditioned, or the tolerance too small, for this precision. `x` is then the last
        iterate.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, tolerances that are negative or
        no numbers, or `maxiter` below 1.
    TypeError
        For arguments of another type, or numbers not in single or double precision.

    See Also
    --------
    gmres : for a matrix that is not positive definite
    richardson

    References
    ----------
    G. L. G. Sleijpen, H. A. van der Vorst, Reliable updated residuals in hybrid Bi-CG methods,
    Computing 56 (1996), for `inner`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(1000)))
    >>> b, M, residuals = np.ones(1000), tmg.fft_preconditioner(A), []
    >>> x, info = tmg.cg(A, b, M=M, rtol=1e-8, maxiter=10, residuals=residuals)
    >>> info, len(residuals) - 1 <= 10, residuals[-1] <= 1e-7 * residuals[0]
    (0, True, True)
    """
    system = check_system(A, b, x0, M, rtol, atol, maxiter, residuals, callback, inner)
    if is_hermitian(system.M) is False:
        warnings.warn(
            f"M is {system.M!r}, which is not symmetric, but cg needs that and may not converge: "
            "give such an M to gmres or richardson, or to cg one that is, as multigrid(A) with "
            "pre = post is",
            stacklevel=2,
        )
    state = Descent(system)
    if state.size_of_b == 0.0:
        return state.zero()
    goal, tell = state.goal(rtol, atol), ranks_of(A).share_errors(callback)

    def watch() -> None:
        if tell is not None:
            tell(state.solution())

    for aim in AIMS:
        if not state.reach(aim * goal, system.maxiter, watch):
            return state.solution(), max(state.iterations, 1)
        state.compute_residual()
        state.record()
        if state.size <= goal:
            return state.solution(), 0
    return state.solution(), state.iterations


@dataclass
class _Inner:
    """A change of the solution, and its residual, in less precision."""

    x: Array
    r: Array
    scale: float = 1.0


class Descent(Iterate):
    """Conjugate gradients, which may be in less precision than the solution.

    What is solved for in less precision is y, where A y + s = (b - A x)/scale, with the residual s
    in the place of r; without `inner` that is x itself.
    """

    def __init__(self, system: System) -> None:
        check_precision(system)
        super().__init__(system)
        A, vectors = system.A if system.inner is None else system.inner, self.vectors
        self._inner: _Inner | None = None
        if system.inner is not None:
            less = np.result_type(A.dtype, np.complex64) if system.dtype.kind == "c" else A.dtype
            y, s = (vectors.zeros(self.x, less) for _ in range(2))
            self._inner = _Inner(y, vectors.copy(self.r, s))
        precondition = _return_same if system.M is None else partial(apply_to_rows, system.M)
        self._products = partial(apply_to_rows, A), precondition
        self._is_true = True  # Whether the residual is that of x, and not that of the recurrence.
        self._last, self._fall = self.size, MOST_FALL

    def begin(self) -> None:
        """Start from the residual, without the directions so far."""
        self._steps = ConjugateGradients(*self._products, self.vectors)

    def advance(self, goal: float) -> bool:
        """Take a step, and a new residual where that of an `inner` recurrence is not reliable."""
        inner = self if self._inner is None else self._inner
        steps, add = self._steps, self.vectors.axpy
        length = steps.step(inner.r)
        if length == 0.0:  # A or M is not positive definite, or not finite.
            return False
        with np.errstate(over="ignore", invalid="ignore"):  # Overflow is told by `info`.
            inner.x = add(length * inner.scale, steps.direction, inner.x)
            inner.r = add(-length, steps.product, inner.r)
        self._is_true = False
        self.size = self.vectors.norm(inner.r)
        if inner is not self and self.size <= max(goal, self._fall * self._last):
            self.compute_residual()
        return True

    def solution(self) -> Array:
        """Return the sum of x and what is solved for in less precision."""
        if self._inner is None:
            return self.x
        # The sum is in the precision of x: that of y may not have numbers as large, or as small.
        y = self.vectors.copy(self._inner.x, self.vectors.empty(self.x))
        return self.x + y * self.scale

    def compute_residual(self) -> None:
        """Compute the residual by a product with A, unless it is as new."""
        if self._is_true:
            return
        self._is_true, inner = True, self._inner
        if inner is not None:
            self.x = self.solution()
            inner.x = self.vectors.zeros(inner.x)
        super().compute_residual()
        if inner is None:
            return
        with np.errstate(over="ignore", invalid="ignore"):  # Overflow is told by `info`.
            error = self.vectors.norm(self.r - inner.r) / self._last
        self._fall = min(error / RELIABLE, MOST_FALL)
        inner.r = self.vectors.copy(self.r, inner.r)
        self._last = self.size = self.vectors.norm(inner.r)


def _return_same(r: Array, out: Array) -> Array:
    return r
