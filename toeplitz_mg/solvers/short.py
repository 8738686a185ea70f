"""One short system: Levinson's recursion and the check of its answers, in the fewest calls."""

from cmath import isfinite
from math import inf

import numpy as np
from scipy.linalg.blas import daxpy, dnrm2, dznrm2, zaxpy

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.solvers.choice import LEVINSON
from toeplitz_mg.solvers.crossovers import (
    RECURSIVE,
    levinson_is_fastest,
    lu_is_faster_than_levinson,
)
from toeplitz_mg.solvers.levinson import levinson
from toeplitz_mg.solvers.refinement import ILL_CONDITIONED, RTOL, SolveInfo
from toeplitz_mg.solvers.system import EPS, USUAL, multiply_one, sum_sizes

BLAS = {"d": (dnrm2, daxpy), "D": (dznrm2, zaxpy)}  # By the character of the dtype.


def solve_short(
    c: Array, r: Array, b: Array, rtol: float | None
) -> tuple[Rows | None, SolveInfo | None]:
    """Solve a short system, if Levinson's recursion is the way, for one column or some.

    It is the first method, the first solution and the first check of `solve_system`. A system of
    some hundred unknowns takes as long as thirty calls of NumPy, and so is given to no function
    that is for other methods, or for numbers of unusual sizes, too.

    Returns
    -------
    X : ndarray of shape (n,), or (columns, n) of several, or None
        The solutions by the recursion; None where the system is not such, another method is, or may
        be, faster, or a number is out of the usual.
    info : SolveInfo or None
        None where X is not the answer: a residual is too large, or may be rounding.
    """
    char, n, (low, high) = c.dtype.char, c.size, USUAL
    if n >= RECURSIVE or char not in BLAS or not char == r.dtype.char == b.dtype.char:
        return None, None
    if not (b.size and 0 < b.ndim <= 2 and c.shape == r.shape == b.shape[:1]):
        return None, None
    columns = b.size // n
    if r is not c and not (c[-1] and r[-1] and isfinite(r[0])):
        return None, None  # It may be triangular.
    if (r is c or c[-1] == r[-1]) and not levinson_is_fastest(n, columns):
        return None, None  # It may be symmetric.
    lags, (measure, _) = np.concatenate([r[:0:-1], c]), BLAS[char]
    if lu_is_faster_than_levinson(n, columns) or not low < measure(lags) < high:
        return None, None
    size = sum_sizes(lags)
    try:
        if columns == 1:
            X, relative, backward = _solve_one(lags, size, b.flatten())
        else:
            parts = zip(*(_solve_one(lags, size, row) for row in b.T.copy()), strict=True)
            X, relative, backward = np.array(next(parts)), *map(max, parts)
    except np.linalg.LinAlgError:
        return None, None
    is_answer = relative <= (RTOL if rtol is None else rtol)
    return X, SolveInfo(LEVINSON, 1, relative, backward) if is_answer else None


def _solve_one(lags: Array, size: float, b: Array) -> tuple[Array, float, float]:
    """Return x, ‖b - A x‖/‖b‖ and the backward error, and leave any numbers in b.

    Both are infinite where x is so large that they may be rounding.
    """
    measure, add = BLAS[b.dtype.char]
    size_of_b, (low, high) = measure(b), USUAL
    if not low < size_of_b < high:
        raise np.linalg.LinAlgError("the right-hand side is to be scaled")
    x = levinson(lags, b)
    terms = size * measure(x)
    if not EPS * terms <= ILL_CONDITIONED * size_of_b:
        return x, inf, inf
    error = measure(add(multiply_one(lags, x), b, len(b), -1.0))
    return x, error / size_of_b, error / (terms + size_of_b)
