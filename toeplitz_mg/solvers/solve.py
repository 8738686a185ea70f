"""The drop-in for `scipy.linalg.solve_toeplitz`: it chooses, solves, and checks the answer."""

import warnings
from collections.abc import Callable
from math import sqrt
from typing import Any, Literal, NamedTuple, overload

import numpy as np
import scipy.linalg
from numpy.linalg import norm
from numpy.typing import ArrayLike, NDArray

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.checks import check_numbers
from toeplitz_mg.solvers.choice import is_symmetric, levinson_is_faster, methods
from toeplitz_mg.solvers.scaling import exponents, scale_back
from toeplitz_mg.values import real

Rows = NDArray[Any]  # right-hand sides or solutions, shape (columns, n)

EPS = float(np.finfo(np.float64).eps)
ROUNDING = 16 * EPS  # backward error at which no correction can be expected to help
ACCEPTED = 1e4 * EPS  # backward error up to which an answer is given
CORRECTION = 1e-2  # relative residual to which a correction is solved for
ILL_CONDITIONED = 1e-8  # relative residual above which the user is told
SINGULAR = 0.1  # relative residual above which there is no answer in float64
GOOD = 64 * EPS  # backward error at which no other method is tried
SHORT = 1024  # unknowns up to which a product by its definition is as fast as by FFT


class SolveInfo(NamedTuple):
    """How `solve_toeplitz` has solved a system."""

    method: str
    iterations: int  # of CG, most of all columns; and corrections by a direct method
    residual: float  # ‖b - A x‖/‖b‖, the largest of all columns
    backward_error: float  # ‖b - A x‖/(‖A‖₁ ‖x‖ + ‖b‖), the largest of all columns


SOLVED = SolveInfo("scipy.linalg.solve_toeplitz", 1, 0.0, 0.0)  # checked, but not reported


@overload
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = ...,
    *,
    rtol: float = ...,
    full_output: Literal[False] = ...,
) -> Array: ...
@overload
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = ...,
    *,
    rtol: float = ...,
    full_output: Literal[True],
) -> tuple[Array, SolveInfo]: ...
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = True,
    *,
    rtol: float = 1e-12,
    full_output: bool = False,
) -> Array | tuple[Array, SolveInfo]:
    """Solve A x = b for a Toeplitz matrix A: the drop-in for `scipy.linalg.solve_toeplitz`.

    A symmetric positive definite system takes O(n log n) operations, or O(n log² n) at worst, in
    the place of O(n²). All others are solved as SciPy does.

    Parameters
    ----------
    c_or_cr : array_like of shape (..., n), or tuple (c, r) of such
        First column, or first column and first row; r[0] is ignored. With a tuple the matrix is
        symmetric where r equals c but for that entry. Leading dimensions are a batch, as in SciPy.
    b : array_like of shape (n,) or (..., n, k)
    check_finite : bool
        Whether to look for numbers that are not finite; the solution for them is not a number.
    rtol : float
        Where ‖b - A x‖ ≤ rtol ‖b‖ the system is solved; where rounding does not allow that, the
        backward error is to be that of a direct method.
    full_output : bool
        Whether to return a `SolveInfo` too; of a batch, that of the worst residual.

    Returns
    -------
    x : ndarray of the shape of `b`, float64 or complex128
    info : SolveInfo
        Only with `full_output`: the fields `method`, `iterations`, `residual`, `backward_error`.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where no method gives an x with a backward error below 2e-12 and a residual below
        0.1 ‖b‖: A is singular, numerically or exactly, or indefinite and too large for Levinson's
        recursion.
    TypeError
        For what is not numbers.
    ValueError
        For shapes that do not match, for numbers that are not finite, or an `rtol` that is not
        between 0 and 1.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        Where the residual ‖b - A x‖ is above 1e-8 ‖b‖ and `rtol`: A is so ill-conditioned that
        no solution in float64 does better, and x may have few correct digits.

    Notes
    -----
    The residual of every answer is computed, and corrected if need be. The file
    ``solvers/choice.py`` says which method is taken, and why.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg import solve_toeplitz
    >>> solve_toeplitz([2.0, 1.0], [4.0, 5.0])
    array([1., 2.])
    >>> c = 1.0 / (1.0 + np.arange(100_000))
    >>> x, info = solve_toeplitz(c, np.ones(100_000), full_output=True)
    >>> info.method, info.residual <= 1e-12
    ('cg, fsai_preconditioner', True)
    """
    if not 0.0 < real("rtol", rtol) < 1.0:
        raise ValueError(f"rtol is {rtol}, but must be between 0 and 1")
    c, r = c_or_cr if isinstance(c_or_cr, tuple) else (c_or_cr, None)
    c, b = _numbers(c, "c"), _numbers(b, "b")
    r = c.conj() if r is None else _numbers(r, "r")
    columns = 1 if b.ndim < 2 else b.shape[-1]
    if not full_output and c.size <= SHORT and levinson_is_faster(c.size, columns):
        x = _short(c, r, b, check_finite, rtol)
        if x is not None:
            return x
    if c.ndim > 1 or r.ndim > 1 or b.ndim > 2:
        x, info = _batch(c, r, b, check_finite, rtol, full_output)
    else:
        x, info = _solve(c, r, b, check_finite, rtol)
    if info.residual > max(ILL_CONDITIONED, rtol):
        warnings.warn(
            f"‖b - A x‖/‖b‖ is {info.residual:.1e} although x is the solution of a system that "
            f"differs from this one by {info.backward_error:.1e}: A is ill-conditioned, and x may "
            "have few correct digits",
            scipy.linalg.LinAlgWarning,
            stacklevel=2,
        )
    return (x, info) if full_output else x


def _numbers(values: ArrayLike, name: str) -> Array:
    array = check_numbers(name, values)
    return array.astype(np.complex128 if array.dtype.kind == "c" else np.float64, copy=False)


def _short(c: Array, r: Array, b: Array, check_finite: bool, rtol: float) -> Array | None:
    """Solve a system so small that Python's overhead rules, or return None."""
    if not c.ndim == r.ndim == 1 or not 1 <= b.ndim <= 2 or b.size == 0:
        return None
    try:
        x = scipy.linalg.solve_toeplitz((c, r), b, check_finite=check_finite)
    except np.linalg.LinAlgError:
        return None
    lags = np.concatenate([r[:0:-1], c])
    with np.errstate(over="ignore", invalid="ignore"):
        if b.ndim == 1:
            b_w, x_w = b, x
            sizes = [_size(b)] if b.any() else []
        else:
            # The sum of the columns with weights is checked. As no weights are in a ratio of
            # integers, nor their sums, errors do not cancel but by accident.
            weights = 2.0 + np.cos(np.arange(b.shape[1]))
            b_w, x_w = b @ weights, x @ weights
            sizes = np.sqrt(np.square(np.abs(b)).sum(axis=0))[b.any(axis=0)].tolist()
        error = _size(b_w - np.convolve(lags, x_w, "valid"))
        rounding = ROUNDING * np.abs(lags).sum() * _size(x_w)
    # Beyond these sizes squares over- or underflow.
    if not all(1e-140 < size < 1e140 for size in sizes) or (sizes and not 0.0 < rounding < np.inf):
        return None
    smallest = min(sizes, default=0.0)
    solved = error <= rtol * smallest or error <= min(rounding, ILL_CONDITIONED * smallest)
    return np.asarray(x) if solved else None


def _size(x: Array) -> float:
    """Return ‖x‖, sooner than by a function that prevents overflow."""
    return sqrt(np.vdot(x, x).real)


def _batch(
    c: Array, r: Array, b: Array, check_finite: bool, rtol: float, full_output: bool
) -> tuple[Array, SolveInfo]:
    """Solve each system of a batch, whose shapes are broadcast."""
    core = min(b.ndim, 2)
    batch = np.broadcast_shapes(c.shape[:-1], r.shape[:-1], b.shape[:-core])
    if 0 in batch:
        raise ValueError(f"the batch has shape {batch}, but must not be empty")
    c, r, b = (
        np.broadcast_to(a, batch + a.shape[a.ndim - k :]) for a, k in ((c, 1), (r, 1), (b, core))
    )
    columns = 1 if core < 2 else b.shape[-1]
    quick = not full_output and c.shape[-1] <= SHORT and levinson_is_faster(c.shape[-1], columns)
    solutions: list[tuple[Array, SolveInfo]] = []
    for k in np.ndindex(batch):
        x = _short(c[k], r[k], b[k], check_finite, rtol) if quick else None
        found = _solve(c[k], r[k], b[k], check_finite, rtol) if x is None else (x, SOLVED)
        solutions.append(found)
    x = np.stack([x for x, _ in solutions]).reshape(b.shape)
    return x, max((info for _, info in solutions), key=lambda info: info.residual)


def _solve(
    c: Array, r: Array, b: Array, check_finite: bool, rtol: float
) -> tuple[Array, SolveInfo]:
    """Solve one system, with one right-hand side or many."""
    if c.ndim != 1 or r.shape != c.shape or b.ndim == 0 or len(b) != len(c):
        raise ValueError(
            f"c has shape {c.shape}, r {r.shape} and b {b.shape}, but all need the length of c"
        )
    for name, a in (("c", c), ("r", r), ("b", b)):
        if check_finite and not np.isfinite(a).all():
            raise ValueError(f"{name} has entries that are not finite")
    complex_matrix = c.dtype.kind == "c" or r.dtype.kind == "c"
    dtype = np.complex128 if complex_matrix else np.float64
    c, r = c.astype(dtype, copy=False), r.astype(dtype, copy=False)
    B = b.reshape(len(c), b.shape[1] if b.ndim == 2 else 1).T
    is_complex = B.dtype.kind == "c"
    if is_complex and not complex_matrix:
        B = np.concatenate([B.real, B.imag])
    B = np.ascontiguousarray(B, dtype)
    if B.size == 0:
        X, info = B, SolveInfo("none", 0, 0.0, 0.0)
    elif not (np.isfinite(c).all() and np.isfinite(r[1:]).all() and np.isfinite(B).all()):
        X, info = np.full_like(B, np.nan), SolveInfo("none", 0, np.nan, np.nan)
    else:
        # Scaled without rounding, so that no norm and no transform over- or underflows; the
        # negative of a negative definite matrix is positive definite.
        of_A, of_B = exponents(np.concatenate([c, r[1:]])), exponents(B)
        scale = np.copysign(np.ldexp(1.0, -of_A), c[0].real)
        X, info = _checked(c * scale, r * scale, B * np.ldexp(1.0, -of_B), rtol)
        parts = 2 if is_complex and not complex_matrix else 1
        X = np.copysign(1.0, c[0].real) * scale_back(X, of_B - of_A, parts)
    if is_complex and not complex_matrix:
        half = len(X) // 2
        X = X[:half] + 1j * X[half:]
    return X.T.reshape(b.shape), info


def _checked(c: Array, r: Array, B: Rows, rtol: float) -> tuple[Rows, SolveInfo]:
    """Solve by the first method whose solutions, corrected, have small residuals."""
    A = ToeplitzOperator(c) if len(c) > SHORT // 4 and is_symmetric(c, r) else None
    multiply = A._matvec if A else _product(c, r)
    size_of_A = float(np.abs(c).sum() + np.abs(r[1:]).sum())  # ≥ ‖A‖₁
    sizes = _norms(B)
    best: tuple[Rows, SolveInfo] | None = None
    tried = ""
    for name, solve in methods(c, r, len(B), A):
        try:
            X, info = _corrected(name, solve, multiply, B, sizes, size_of_A, rtol)
        except np.linalg.LinAlgError:
            continue
        if best is None or info.backward_error < best[1].backward_error:
            best = X, info
        if info.residual <= rtol or (info.backward_error <= GOOD and info.residual <= SINGULAR):
            return X, info
        tried += (
            f"; by {name} ‖b - A x‖ is {info.residual:.1e} ‖b‖ and the backward error "
            f"{info.backward_error:.1e}"
        )
    if best and best[1].backward_error <= ACCEPTED and best[1].residual <= SINGULAR:
        return best
    raise np.linalg.LinAlgError(
        "A is singular, exactly or numerically, or too large and not positive definite" + tried
    )


def _corrected(
    name: str,
    solve: Callable[[Rows, float], tuple[Rows, int]],
    multiply: Callable[[Rows], Rows],
    B: Rows,
    sizes: Array,
    size_of_A: float,
    rtol: float,
) -> tuple[Rows, SolveInfo]:
    """Solve, and correct the solution by that of its residual while this helps."""
    X, iterations = solve(B, 0.9 * rtol)  # the recurrence for the residual may drift
    result = X, SolveInfo(name, iterations, np.inf, np.inf)
    with np.errstate(over="ignore", invalid="ignore"):  # seen in the residual
        while True:
            R = B - multiply(X)
            errors, scales = _norms(R), size_of_A * _norms(X)
            info = SolveInfo(
                name,
                iterations,
                _largest(errors, sizes),
                _largest(errors, scales + sizes),
            )
            if not info.backward_error < result[1].backward_error / 2:
                return result
            result = X, info
            if (errors <= np.maximum(rtol * sizes, ROUNDING * scales)).all():
                return result
            correction, steps = solve(R, CORRECTION)
            X = X + correction
            iterations += steps


def _product(c: Array, r: Array) -> Callable[[Rows], Rows]:
    """Return the product of A with rows, as cheap as can be for the size of A."""
    if len(c) <= SHORT // 4:
        A = scipy.linalg.toeplitz(c, r)
        return lambda X: X @ A.T
    if c.dtype == np.float64:
        return ToeplitzOperator(c, r)._matvec
    return lambda X: np.asarray(scipy.linalg.matmul_toeplitz((c, r), X.T)).T


def _norms(X: Rows) -> Array:
    return np.asarray(norm(X, axis=1))


def _largest(errors: Array, sizes: Array) -> float:
    """Return the largest relative error; that of zero in place of zero is zero."""
    relative = np.divide(errors, sizes, out=np.zeros_like(errors), where=errors != 0.0)
    return float(relative.max())
