"""Many small symmetric Toeplitz systems at once, as frames of linear prediction are."""

from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.solvers.levinson import levinson_of_batch
from toeplitz_mg.solvers.system import EPS, USUAL

# `python -m comparisons.workloads --jobs batch` times a batch, beside a revision with other values.
LARGEST = 64  # Most unknowns of a system: above some 100 SciPy's recursion is as fast for each.
FEWEST = 50  # Fewest systems that are worth the calls of one recursion more.
NUMBERS = 2**16  # Numbers of an array of systems that are solved together: they stay in the cache.


class Solutions(NamedTuple):
    """Solutions of systems, and how good they are.

    Attributes
    ----------
    x : ndarray of shape (systems, n, k)
    residuals, backward_errors : ndarray of shape (systems,)
        The largest of all columns (see `SolveInfo`); not a number where there is no solution,
        where the sizes of numbers are unusual, or where x is so large that its residual is
        rounding.
    """

    x: Array
    residuals: Array
    backward_errors: Array


def is_faster_at_once(systems: int, n: int) -> bool:
    """Whether one recursion is faster than one for each: it takes some calls for each unknown."""
    return n <= LARGEST and systems >= max(FEWEST, 2 * n)


def solve_at_once(c: Array, b: Array) -> Solutions:
    """Solve symmetric systems by Levinson's recursion.

    Parameters
    ----------
    c : ndarray of shape (systems, n), float64
    b : ndarray of shape (systems, n, k), float64
    """
    x = np.empty(b.shape)
    residuals, backward_errors = np.empty((2, len(b)))
    size = max(1, NUMBERS // b[0].size)
    for start in range(0, len(b), size):
        part = slice(start, start + size)
        # A step of the recursion is then one operation for all systems.
        columns, right = (np.ascontiguousarray(np.moveaxis(a[part], 0, -1)) for a in (c, b))
        y = levinson_of_batch(columns, right)
        x[part] = np.moveaxis(y, -1, 0)
        residuals[part], backward_errors[part] = _errors(columns, y, right)
    return Solutions(x, residuals, backward_errors)


def _errors(c: Array, x: Array, b: Array) -> tuple[Array, Array]:
    """Return the residuals and the backward errors, shape (systems,), which is the last axis."""
    n, systems = c.shape
    lags = np.concatenate([c[:0:-1], c])
    step, next_one = lags.strides
    # A[i, j] is the lag i - j.
    A = np.ndarray((n, n, systems), lags.dtype, lags, (n - 1) * step, (step, -step, next_one))
    r = b - np.einsum("ijs,jks->iks", A, x)
    errors, of_x, of_b = (np.sqrt(np.einsum("nks,nks->ks", v, v)) for v in (r, x, b))
    sizes = np.abs(c)
    of_A = 2.0 * sizes.sum(axis=0) - sizes[0]
    low, high = USUAL
    is_usual = (low < of_A) & (of_A < high) & (low < of_b) & (of_b < high)
    is_known = is_usual & (EPS * of_A * of_x <= of_b)
    residuals = np.where(is_known, errors / of_b, np.nan)
    return residuals.max(axis=0), (errors / (of_A * of_x + of_b)).max(axis=0)
