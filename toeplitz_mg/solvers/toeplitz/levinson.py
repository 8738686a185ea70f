"""Recursions with O(n²) operations: Levinson's for one or for many small systems, and Trench's.

For one system, Levinson's recursion is SciPy's. For many small systems, such as frames in linear
prediction, one recursion in NumPy solves all. Trench's recursion gives the first column and row of
the inverse in two thirds of Levinson's operations. The Gohberg-Semencul formula then solves for a
right-hand side, or corrects a solution, in O(n log n).

References
----------
N. Levinson, The Wiener RMS error criterion in filter design and prediction, J. Math. Phys. 25
(1946); W. F. Trench, An algorithm for the inversion of finite Toeplitz matrices, J. SIAM 12 (1964).
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.linalg import get_blas_funcs

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.threads import PIECE
from toeplitz_mg.engine.vectors import PART
from toeplitz_mg.solvers.toeplitz.sizes import LARGEST_AT_ONCE
from toeplitz_mg.solvers.toeplitz.system import USUAL

Recursion = Callable[[Array, Array], Any]  # Maps lags and b to x and a second, unused result.


def levinson(lags: Array, B: Rows) -> Rows:
    """Return the solution by Levinson's recursion, in O(n²) operations for each right-hand side.

    Parameters
    ----------
    lags : ndarray of shape (2 n - 1,), float64 or complex128
        The coefficients a[i - j], lag zero in the centre.
    B : ndarray of shape (n,) or (columns, n), of that dtype

    Raises
    ------
    numpy.linalg.LinAlgError
        If a leading block is singular.
    """
    solve = recursion()
    if B.ndim == 1:
        return solve(lags, B)[0]
    X = np.empty_like(B)
    for k, b in enumerate(B):  # `numpy.stack` would take a noticeable time in small systems.
        X[k] = solve(lags, b)[0]
    return X


@cache
def recursion() -> Recursion:
    """Return SciPy's compiled recursion, or its public function if the private one has changed.

    The public function checks its arguments, which takes several times as long in small systems.
    The private one may change or disappear in any release, so that it is tested first.
    """
    lags, b = np.array([0.5, 1.0, 4.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0])
    try:
        from scipy.linalg._solve_toeplitz import levinson as compiled

        for a, right in ((lags, b), (lags * (1.0 + 0.5j), b * 1j)):
            x = compiled(a, right)[0]
            if not np.allclose(np.convolve(a, x, "valid"), right, rtol=1e-12):
                return _public
    except (ImportError, TypeError, ValueError):
        return _public
    return compiled


def _public(lags: Array, b: Array) -> tuple[Array, None]:
    n = len(b)
    x = scipy.linalg.solve_toeplitz((lags[n - 1 :], lags[n - 1 :: -1]), b, check_finite=False)
    return x, None


def levinson_of_batch(C: Array, R: Array | None, B: Array) -> Array:
    """Return the solutions of many systems; a singular leading block gives non-finite numbers.

    Parameters
    ----------
    C : ndarray of shape (n, systems)
        The first column of each matrix.
    R : ndarray of shape (n, systems), or None
        The first rows, whose first entries are ignored; None for Hermitian matrices.
    B : ndarray of shape (n, k, systems)
        k right-hand sides for each matrix.
    """
    n, systems = C.shape
    x = np.zeros(B.shape, np.result_type(C, C if R is None else R, B))
    # The predictors: A f = (e, 0, …, 0) and A g = (0, …, 0, e) for the leading block. If A is
    # Hermitian, g is the reversed conjugate of f.
    f = np.zeros((n, systems), C.dtype)
    f[0] = 1.0
    g, before = f if R is None else f.copy(), f if R is None else f.copy()
    e = C[0].real.copy() if R is None else C[0].copy()
    x[0] = B[0] / e
    for k in range(1, n):
        column = C[k:0:-1]
        below = np.einsum("ks,ks->s", f[:k], column)
        rest = B[k] - np.einsum("kcs,ks->cs", x[:k], column)
        if R is None:
            f[1 : k + 1] -= below / e * f[k - 1 :: -1].conj()
            e = e - (below.conj() * below).real / e
            g = f[k::-1].conj()
        else:
            above = np.einsum("ks,ks->s", g[:k], R[1 : k + 1])
            before[1 : k + 1] = g[:k]
            before[0] = 0.0
            before[:k] -= above / e * f[:k]
            f[1 : k + 1] -= below / e * g[:k]
            g, before = before, g
            e = e - below / e * above
        x[: k + 1] += rest / e * g[: k + 1, np.newaxis]
    return x


class Solutions(NamedTuple):
    """Solutions of systems, with residuals and backward errors.

    Attributes
    ----------
    x : ndarray of shape (systems, n, k)
    residuals, backward_errors : ndarray of shape (systems,)
        The largest over all columns (see `SolveInfo`). A residual is NaN if there is no solution,
        if norms are extremely large or small, or if x is so large that its residual is only
        rounding error. A backward error is NaN if there is no solution.
    """

    x: Array
    residuals: Array
    backward_errors: Array


def is_faster_at_once(systems: int, n: int) -> bool:
    """Whether one recursion for all systems is faster; it has a call overhead for each unknown."""
    return n <= LARGEST_AT_ONCE and systems >= 2 * n


def solve_at_once(c: Array, r: Array | None, b: Array) -> Solutions:
    """Return the solutions of many systems by Levinson's recursion, with their errors.

    Parameters
    ----------
    c : ndarray of shape (systems, n), float64 or complex128
    r : ndarray of the same kind, or None
        The first rows; None for Hermitian matrices.
    b : ndarray of shape (systems, n, k), float64 or complex128
    """
    x = np.empty(b.shape, np.result_type(c, c if r is None else r, b))
    residuals, backward_errors = np.empty((2, len(b)))
    size = max(1, PIECE // b[0].size)  # As many systems as stay in the cache.

    def turn(a: Array) -> Array:
        return np.ascontiguousarray(np.moveaxis(a[part], 0, -1))

    for start in range(0, len(b), size):
        part = slice(start, start + size)
        # With the systems on the last axis, each step is one operation for all of them.
        C, R, B = turn(c), None if r is None else turn(r), turn(b)
        y = levinson_of_batch(C, R, B)
        x[part] = np.moveaxis(y, -1, 0)
        residuals[part], backward_errors[part] = _errors(C, C.conj() if R is None else R, y, B)
    return Solutions(x, residuals, backward_errors)


def _errors(c: Array, r: Array, x: Array, b: Array) -> tuple[Array, Array]:
    """Return the residuals and the backward errors; systems are on the last axis."""
    n, systems = c.shape
    lags = np.concatenate([r[:0:-1], c])
    step, next_one = lags.strides
    # A[i, j] is the coefficient with lag i - j.
    A = np.ndarray((n, n, systems), lags.dtype, lags, (n - 1) * step, (step, -step, next_one))
    rest = b - np.einsum("ijs,jks->iks", A, x)
    errors, of_x, of_b = (np.sqrt(np.einsum("nks,nks->ks", v, v.conj()).real) for v in (rest, x, b))
    sizes = np.abs(lags)
    of_A = sizes.sum(axis=0)
    low, high = USUAL
    is_usual = (low < of_A) & (of_A < high) & (low < of_b) & (of_b < high)
    is_known = is_usual & (EPS * of_A * of_x <= of_b)
    of_lags = np.sqrt(np.square(sizes).sum(axis=0))
    rounding = EPS * (of_lags * of_x + 0.5 * of_b)  # As `ToeplitzSystem.rounding_of`.
    residuals = np.where(is_known, np.maximum(errors, rounding) / of_b, np.nan)
    return residuals.max(axis=0), (errors / (of_A * of_x + of_b)).max(axis=0)


def column_and_row_of_inverse(c: Array, r: Array) -> tuple[Array, Array]:
    """Return A⁻¹ e₁ and A⁻ᵀ e₁, in 2 n² steps, or 1.5 n² if r is c.

    For the leading block with m unknowns, the predictors f and g satisfy A f = (e, 0, …, 0),
    A g = (0, …, 0, e) and f₀ = g_(m-1) = 1. A step extends both by a zero. A multiple of the other
    predictor then cancels the entry that this leaves in A f or A g.

    Parameters
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row; the same array if A is known to be symmetric.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a leading block is singular.
    """
    n = len(c)
    names = ("dotu" if c.dtype.kind == "c" else "dot", "axpy", "copy")
    dot, axpy, copy = get_blas_funcs(names, dtype=c.dtype)
    reversed_c = np.ascontiguousarray(c[::-1])
    f, g, before = (np.zeros_like(c) for _ in range(3))
    f[0] = g[n - 1] = 1.0  # g occupies the end of its array.
    e = c[0]
    for m in range(1, n):
        if e == 0.0:
            raise np.linalg.LinAlgError(f"the leading {m} × {m} block is singular")
        if m == PART:  # For longer vectors OpenBLAS would start threads.
            dot, axpy = partial(_sum_of_pieces, dot), partial(_add_in_pieces, axpy)
        start = n - 1 - m
        below = dot(reversed_c, f, m, start, 1, 0, 1)
        above = below if r is c else dot(r, g, m, 1, 1, start + 1, 1)
        copy(f, before, m)
        axpy(g, f, m + 1, -below / e, start, 1, 0, 1)
        axpy(before, g, m, -above / e, 0, 1, start, 1)
        e -= below / e * above
    if e == 0.0:
        raise np.linalg.LinAlgError("the matrix is singular")
    return f / e, g[::-1] / e


def _sum_of_pieces(
    dot: Any, x: Array, y: Array, size: int, i: int, di: int, j: int, dj: int
) -> Any:
    """Return the result of BLAS's `dot` for these arguments, computed piece by piece."""
    pieces = range(0, size, PART)
    return sum(dot(x, y, min(PART, size - k), i + k, di, j + k, dj) for k in pieces)


def _add_in_pieces(
    axpy: Any, x: Array, y: Array, size: int, a: Any, i: int, di: int, j: int, dj: int
) -> None:
    """Update y as BLAS's `axpy` does for these arguments, piece by piece."""
    for k in range(0, size, PART):
        axpy(x, y, min(PART, size - k), a, i + k, di, j + k, dj)
