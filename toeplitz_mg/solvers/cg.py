"""Preconditioned conjugate gradients whose iterations allocate no memory."""

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
# Largest factor by which ‖r‖ falls before an `inner` residual is recomputed, also used at first. A
# larger factor would recompute it too often.
MOST_FALL = 0.3
# Goals of the recurrence in each start, relative to the tolerance, because it may drift from the
# true residual. If rounding spoils the second start, it would also spoil a third.
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
    """Solve A x = b by preconditioned conjugate gradients.

    Drop-in for `scipy.sparse.linalg.cg`, with the same iterates. In addition, the true residual is
    checked before ``info = 0`` is returned, which takes one more product; inner products neither
    over- nor underflow, however large or small `b` is; and iterations allocate no vectors.

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
        Symmetric positive definite, or Hermitian positive definite.
    b : array_like of shape (n,) or (n, 1)
    x0 : array_like of shape (n,) or (n, 1), or "Mb", optional
        Initial guess, by default zero; "Mb" stands for ``M @ b``. It is not changed. A guess whose
        residual is so large that `b` underflows beside it is ignored.
    rtol, atol : float
        The iteration has converged if ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol). When the recurrence for
        the residual meets this, the true residual is computed in the precision of `A` and `b`. If
        rounding has made it larger, the iteration is restarted from there.
    maxiter : int, optional
        Maximum number of iterations, by default 10 n.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`, Hermitian positive definite; it may be in single precision. An
        operator known not to be symmetric, such as a V(0,1) cycle, causes a warning.
    callback : callable, optional
        Called as ``callback(xk)`` after each iteration. The array `xk` is reused: copy it to keep
        it.
    inner : LinearOperator, optional
        `A` in lower precision, for example ``A.astype(np.float32)``. The iteration then uses that
        precision, and the residual is recomputed with `A` whenever it may be wrong by 0.1 %, mostly
        two or three times. This pays for condition numbers of some thousands, but not above 1e6.
        Preferably `M` has that precision too.
    residuals : list, optional
        Its contents are replaced by ‖b - A x‖₂ of the initial guess and after each iteration. All
        but the first and the last are norms from the recurrence.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 if the iteration has converged, otherwise the number of iterations (at least 1). Reasons:
        `maxiter` is reached; `A` or `M` is found not to be positive definite or not finite; `A` is
        too ill-conditioned, or the tolerance too small, for this precision. `x` is then the last
        iterate.

    Raises
    ------
    ValueError
        If shapes do not match, numbers are not finite, a tolerance is negative or not a number, or
        `maxiter` is below 1.
    TypeError
        If an argument has another type, or numbers are not in single or double precision.

    See Also
    --------
    gmres : for matrices that are not positive definite.
    richardson : for preconditioners that are not symmetric.

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
            "use such an M with gmres or richardson, or for cg one that is, such as multigrid(A) "
            "with pre = post",
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
    """A correction of the solution, and its residual, in lower precision."""

    x: Array
    r: Array
    scale: float = 1.0


class Descent(Iterate):
    """Conjugate gradients, possibly in lower precision than the solution.

    With `inner` the unknown is y in A y + s = (b - A x)/scale, where s is the residual in lower
    precision; without `inner` it is x itself.
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
        self._is_true = True  # Whether r is the true residual, and not that of the recurrence.
        self._last, self._fall = self.size, MOST_FALL

    def begin(self) -> None:
        """Start from the residual, without previous directions."""
        self._steps = ConjugateGradients(*self._products, self.vectors)

    def advance(self, goal: float) -> bool:
        """Take a step; recompute the residual if the `inner` recurrence is no longer reliable."""
        inner = self if self._inner is None else self._inner
        steps, add = self._steps, self.vectors.axpy
        length = steps.step(inner.r)
        if length == 0.0:  # A or M is not positive definite, or not finite.
            return False
        with np.errstate(over="ignore", invalid="ignore"):  # `info` reports overflow.
            inner.x = add(length * inner.scale, steps.direction, inner.x)
            inner.r = add(-length, steps.product, inner.r)
        self._is_true = False
        self.size = self.vectors.norm(inner.r)
        if inner is not self and self.size <= max(goal, self._fall * self._last):
            self.compute_residual()
        return True

    def solution(self) -> Array:
        """Return the sum of x and the correction in lower precision."""
        if self._inner is None:
            return self.x
        # Add in the precision of x, because that of y may have too small a range.
        y = self.vectors.copy(self._inner.x, self.vectors.empty(self.x))
        return self.x + y * self.scale

    def compute_residual(self) -> None:
        """Compute the residual by a product with A, unless it is already the true one."""
        if self._is_true:
            return
        self._is_true, inner = True, self._inner
        if inner is not None:
            self.x = self.solution()
            inner.x = self.vectors.zeros(inner.x)
        super().compute_residual()
        if inner is None:
            return
        with np.errstate(over="ignore", invalid="ignore"):  # `info` reports overflow.
            error = self.vectors.norm(self.r - inner.r) / self._last
        self._fall = min(error / RELIABLE, MOST_FALL)
        inner.r = self.vectors.copy(self.r, inner.r)
        self._last = self.size = self.vectors.norm(inner.r)


def _return_same(r: Array, out: Array) -> Array:
    return r
