"""Preconditioned conjugate gradients that allocate nothing in an iteration."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.checks import (
    System,
    check_precision,
    check_system,
)
from toeplitz_mg.solvers.iterate import Iterate

RELIABLE = 1e-3  # Relative error of an `inner` residual that does not disturb the iteration.
# Factors by which ‖r‖ falls before an `inner` residual is computed anew: the least, the first, and
# that where the residual is rough, as to compute it more often costs too much.
LEAST_FALL, FIRST_FALL, MOST_FALL = 1e-5, 0.1, 0.5
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
    x0 : array_like of shape (n,) or (n, 1), optional
        First guess, zero by default. It is not changed. One beside whose residual b underflows is
        not taken.
    rtol, atol : float
        It has converged where ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol). The recurrence for the residual
        says when to stop; then the true one is computed, with one product more in the precision of
        `A` and `b`, and where rounding has made it larger than that goal the iteration starts once
        more from there.
    maxiter : int, optional
        Most iterations, 10 n by default.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`, symmetric or Hermitian positive definite. It may be in
        float32.
    callback : callable, optional
        Called as ``callback(xk)`` with the iterate after each iteration. The array is used again:
        copy what is to be kept.
    inner : LinearOperator, optional
        `A` in less precision, such as ``A.astype(np.float32)``. The iteration is then in that
        precision, but for the residual, which is computed anew with `A` at the end and whenever
        it may be wrong by 0.1 %: twice or three times where `A` has a condition number of some
        thousands, as with two axes. There it takes as many iterations to the same residual, in
        4/5 of the time. Where the condition number is above 1e6 it does not pay. `M` had
        best be in that precision too.
    residuals : list, optional
        It is filled with ‖b - A x‖₂ of the first guess and after each iteration, so that there are
        ``len(residuals) - 1`` iterations. What was in it is lost. The norms are those of the
        recurrence, but for those that are computed: the first one, and the last where it has
        converged.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 where it has converged: ‖b - A x‖₂ itself is at the goal. Otherwise the iterations done
        (at least 1): they are used up; or `A` or `M` is found not to be positive definite, or not
        to be finite; or no such residual is found in two starts, as `A` is too ill-conditioned
        for this precision, or the tolerance too small. `x` is then the last iterate.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, negative tolerances, or
        `maxiter` below 1.
    TypeError
        For what is not of numbers, or not in single or double precision, a `maxiter` that is no
        integer, or `residuals` that are no list.

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
    state = _Descent(system)
    if state.whole.size_of_b == 0.0:
        return state.whole.zero()
    goal = state.goal(rtol, atol)
    for aim in AIMS:
        if not _descend(state, system, aim * goal, callback):
            return state.x, max(state.iterations, 1)
        if state.true_residual() <= goal:
            return state.x, 0
    return state.x, state.iterations


def cg_by_recurrence(
    A: LinearOperator,
    b: Array,
    *,
    M: LinearOperator | None,
    rtol: float,
    maxiter: int,
    residuals: list[float] | None = None,
    callback: Callable[[Array], object] | None = None,
) -> tuple[Array, int, bool]:
    """Return what `cg` finds by the recurrence alone, its iterations, and whether it converged.

    It is for those who compute the residual of the result themselves, and correct it.
    """
    system = check_system(A, b, None, M, rtol, 0.0, maxiter, residuals)
    state = _Descent(system)
    converged = _descend(state, system, state.goal(rtol, 0.0), callback)
    return state.x, state.iterations, converged


def _descend(
    state: "_Descent", system: System, goal: float, callback: Callable[[Array], object] | None
) -> bool:
    """Iterate from r anew; whether the recurrence for the residual reaches the goal."""
    M = system.M
    precondition = _return_same if M is None else partial(apply_to_rows, M)
    multiply = partial(apply_to_rows, state.A)
    iteration = ConjugateGradients(multiply, precondition, system.vectors)
    size = state.residual(goal)
    while not size <= goal:
        if state.iterations == system.maxiter:
            return False
        length = iteration.step(state.r)
        if length == 0.0:  # A or M is not positive definite, or not finite.
            return False
        with np.errstate(over="ignore", invalid="ignore"):  # Overflow is told by `info`.
            state.step(length, iteration)
        size = state.residual(goal)
        if callback is not None:
            callback(state.x)
    return True


def _return_same(r: Array, out: Array) -> Array:
    return r


@dataclass
class _Inner:
    """A change of the solution, and its residual, in less precision."""

    x: Array
    r: Array
    scale: float = 1.0


class _Descent:
    """The iterate of conjugate gradients, which may have less precision than the solution.

    What is solved for in less precision is y, where A y + r = (b - A x)/scale, with the `x` and
    the scale of the `Iterate`; without `inner` it is that one itself.
    """

    def __init__(self, system: System) -> None:
        dtype = check_precision(system)
        inner = system.inner
        A = system.A if inner is None else inner
        self.whole = whole = Iterate(system)
        self.A, self._vectors, self._goes_within = A, system.vectors, inner is not None
        self.goal = whole.goal
        self._inner: Iterate | _Inner = whole
        if inner is not None:
            less = np.result_type(A.dtype, np.complex64) if dtype.kind == "c" else A.dtype
            y, r = (self._vectors.zeros(whole.x, less) for _ in range(2))
            self._inner = _Inner(y, self._vectors.copy(whole.r, r))
        self._is_true = True  # Whether r is that of x, and not that of the recurrence.
        self._last = self._vectors.norm(self.r)
        self._fall = FIRST_FALL

    @property
    def r(self) -> Array:
        """The residual, in the precision of the iteration."""
        return self._inner.r

    @property
    def iterations(self) -> int:
        """How many there have been."""
        return self.whole.iterations

    @property
    def x(self) -> Array:
        """The solution so far."""
        x = self.whole.x
        return x + self._from_inner() if self._goes_within else x

    def _from_inner(self) -> Array:
        # The sum is in the precision of x: that of y may not have numbers as large, or as small.
        whole = self.whole
        return self._vectors.copy(self._inner.x, self._vectors.empty(whole.x)) * whole.scale

    def step(self, length: float, iteration: ConjugateGradients) -> None:
        """Go so far along the direction of an iteration."""
        inner, add = self._inner, self._vectors.axpy
        inner.x = add(length * inner.scale, iteration.direction, inner.x)
        inner.r = add(-length, iteration.product, inner.r)
        self.whole.iterations += 1
        self._is_true = False

    def residual(self, goal: float) -> float:
        """Return ‖r‖ by the recurrence; of an `inner` computed anew where that is not reliable."""
        size = self._vectors.norm(self.r)
        if self._goes_within and size <= max(goal, self._fall * self._last):
            return self.true_residual()
        self.whole.record(size)
        return size

    def true_residual(self) -> float:
        """Compute r anew, unless it is as new, and return ‖r‖."""
        if not self._is_true:
            self._compute_residual()
            self._is_true = True
            self._last = self._vectors.norm(self.r)
        self.whole.record(self._last)
        return self._last

    def _compute_residual(self) -> None:
        whole = self.whole
        if not self._goes_within:
            whole.compute_residual()
            return
        whole.x += self._from_inner()
        self._inner.x = self._vectors.zeros(self._inner.x)
        whole.compute_residual()
        with np.errstate(over="ignore", invalid="ignore"):  # Overflow is told by `info`.
            error = self._vectors.norm(whole.r - self.r) / self._last
        self._fall = min(max(error / RELIABLE, LEAST_FALL), MOST_FALL)
        self._inner.r = self._vectors.copy(whole.r, self.r)
