"""Preconditioned conjugate gradients that allocate nothing in an iteration."""

from collections.abc import Callable
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import get_blas_funcs
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.checks import checked_system

Array = NDArray[Any]

RELIABLE = 1e-3  # error of the residual in less precision that does not disturb the iteration
PART = 2**13  # numbers of a vector that BLAS does not share among threads
FALLS = 1e-5, 0.1  # least and first fall of the residual before it is computed anew


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
) -> tuple[Array, int]:
    """Solve A x = b by conjugate gradients, as `scipy.sparse.linalg.cg` does, but faster.

    The iterates are the same. SciPy allocates its vectors anew in every step: in 2^20 unknowns,
    with M of this package, 15 % of its time is spent beside the products, here 3 to 9 %.

    Parameters
    ----------
    A : array_like, sparse matrix or LinearOperator, of shape (n, n)
        Real, symmetric positive definite.
    b : array_like of shape (n,) or (n, 1)
    x0 : array_like of shape (n,) or (n, 1), optional
        First guess, zero by default. It is not changed.
    rtol, atol : float
        It has converged where ‖b - A x‖₂ ≤ max(rtol ‖b‖₂, atol), by the recurrence for the
        residual.
    maxiter : int, optional
        Most iterations, 10 n by default.
    M : array_like, sparse matrix or LinearOperator, optional
        Approximate inverse of `A`, symmetric positive definite. It may be in float32.
    callback : callable, optional
        Called as ``callback(xk)`` with the iterate after each iteration. The array is used again:
        copy what is to be kept.
    inner : LinearOperator, optional
        `A` in less precision, such as ``A.astype(np.float32)``. The iteration is then in that
        precision, but for the residual, which is computed anew with `A` at the end and whenever
        it may be wrong by 0.1 %: twice or three times where `A` has a condition number of some
        thousands, as in two levels. There it takes as many iterations to the same residual, in
        4/5 of the time. Where the condition number is above 1e6 it does not pay. `M` had
        best be in that precision too.

    Returns
    -------
    x : ndarray of shape (n,)
    info : int
        0 where it has converged. Otherwise the iterations done (at least 1): they are used up, or
        `A` or `M` is found not to be positive definite. `x` is then the last iterate.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, negative tolerances, or
        `maxiter` below 1.
    TypeError
        For what is not real, or a `maxiter` that is no integer.

    References
    ----------
    G. L. G. Sleijpen, H. A. van der Vorst, Reliable updated residuals in hybrid Bi-CG methods,
    Computing 56 (1996), for `inner`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(1000)))
    >>> x, info = tmg.cg(A, np.ones(1000), M=tmg.fft_preconditioner(A), rtol=1e-8, maxiter=10)
    >>> info
    0
    """
    A, M, b, guess, maxiter = checked_system(A, b, x0, M, rtol, atol, maxiter)
    n = len(b)
    dtype = np.result_type(A.dtype, b.dtype, b.dtype if guess is None else guess.dtype)
    if dtype.char not in "fd":
        raise TypeError(f"A and b give the dtype {dtype}, but the iteration is for real numbers")

    state = _Iterate(A, inner, b, guess, dtype)
    vectors = _Vectors(n, state.r.dtype)
    r, y = state.r, state.y
    goal = max(rtol * state.size_of_b, atol) / state.scale
    if goal == 0.0 and not b.any():
        return np.zeros(n, dtype), 0
    p, q = np.empty_like(r), np.empty_like(r)
    rho = 0.0
    iterations = 0
    while not state.residual(vectors.norm(r), goal) <= goal:
        if iterations == maxiter:
            return state.x, iterations
        z = r if M is None else apply_to_rows(M, r, q)
        rho, previous = vectors.dot(r, z), rho
        if not rho > 0.0:  # M is not positive definite, or r is not finite
            return state.x, max(iterations, 1)
        if iterations == 0:
            p[:] = z
        else:
            vectors.scale(p, rho / previous)
            vectors.add(p, 1.0, z)
        apply_to_rows(state.A, p, q)
        curvature = vectors.dot(p, q)
        if not curvature > 0.0:  # A is not positive definite
            return state.x, max(iterations, 1)
        vectors.add(y, rho / curvature, p)
        vectors.add(r, -rho / curvature, q)
        iterations += 1
        if callback is not None:
            callback(state.x)
    return state.x, 0


class _Vectors:
    """Operations with vectors by BLAS, part by part.

    Of a long vector BLAS takes as many threads as it has, which wait for each other, and then for
    more to do on the cores that the products need.
    """

    def __init__(self, n: int, dtype: np.dtype[Any]) -> None:
        self._parts = [slice(k, k + PART) for k in range(0, n, PART)]
        names = ("axpy", "dot", "nrm2", "scal")
        self._axpy, self._dot, self._nrm2, self._scal = get_blas_funcs(names, dtype=dtype)

    def add(self, y: Array, a: float, x: Array) -> None:
        """Add a x to y."""
        for part in self._parts:
            self._axpy(x[part], y[part], a=a)

    def scale(self, x: Array, a: float) -> None:
        """Multiply x by a."""
        for part in self._parts:
            self._scal(a, x[part])

    def dot(self, x: Array, y: Array) -> float:
        """The inner product."""
        return sum(float(self._dot(x[part], y[part])) for part in self._parts)

    def norm(self, x: Array) -> float:
        """The 2-norm."""
        return hypot(*(self._nrm2(x[part]) for part in self._parts))


def _operator(inner: Any) -> LinearOperator:
    try:
        return aslinearoperator(inner)
    except TypeError:
        raise TypeError(
            f"inner is {inner!r}, but must be A in less precision, as A.astype(np.float32)"
        ) from None


class _Iterate:
    """The solution and its residual, for an iteration that may have less precision.

    The iteration changes `y` and `r`, with A (scale y) + scale r = b - A (what is in x already).
    """

    def __init__(
        self, A: LinearOperator, inner: Any, b: Array, guess: Array | None, dtype: Any
    ) -> None:
        self._A, self._b = A, b.astype(dtype, copy=False)
        self.size_of_b = float(get_blas_funcs("nrm2", dtype=dtype)(self._b))
        self._x = np.zeros(len(b), dtype) if guess is None else guess.astype(dtype)
        r = self._b if guess is None else self._b - apply_to_rows(A, self._x)
        if inner is None:
            self.A, self.scale = A, 1.0
            self.r, self.y = r.astype(dtype), self._x  # a copy: it may be b
        else:
            self.A = _operator(inner)
            if self.A.shape != A.shape:
                raise ValueError(f"inner has shape {self.A.shape}, but A has {A.shape}")
            if np.dtype(self.A.dtype).char not in "fd":
                raise TypeError(f"inner has dtype {self.A.dtype}, but must be of real numbers")
            # Scaled: in float32 the squares of small numbers are zero.
            self.scale = self.size_of_b or 1.0
            self.r = (r / self.scale).astype(self.A.dtype)
            self.y = np.zeros(len(b), self.A.dtype)
        self._last = float(np.linalg.norm(self.r))
        self._fall = FALLS[1]

    @property
    def x(self) -> Array:
        """The solution so far."""
        return self._x if self.y is self._x else self._x + self.scale * self.y

    def residual(self, size: float, goal: float) -> float:
        """Return ‖r‖, given that of the recurrence; computed anew where that is not reliable."""
        if self.y is self._x or size > max(goal, self._fall * self._last) or not self.y.any():
            return size
        self._x += self.scale * self.y
        self.y[:] = 0.0
        r = (self._b - apply_to_rows(self._A, self._x)) / self.scale
        error = float(np.linalg.norm(r - self.r)) / self._last
        self._fall = min(max(error / RELIABLE, FALLS[0]), 0.5)
        self.r[:] = r
        self._last = float(np.linalg.norm(r))
        return self._last
