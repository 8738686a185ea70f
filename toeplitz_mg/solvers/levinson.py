"""Levinson's recursion: SciPy's for one system, and one for many small systems at once.

References
----------
N. Levinson, The Wiener RMS error criterion in filter design and prediction, J. Math. Phys. 25
(1946).
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg

from toeplitz_mg._typing import Array, Rows

Recursion = Callable[[Array, Array], Any]  # From lags and b to x and something else.


def levinson(lags: Array, B: Rows) -> Rows:
    """Solve by Levinson's recursion, in n² steps for each right-hand side.

    Parameters
    ----------
    lags : ndarray of shape (2 n - 1,), float64 or complex128
        The coefficients a[i - j], lag zero in the centre.
    B : ndarray of shape (n,) or (columns, n), of that dtype

    Raises
    ------
    numpy.linalg.LinAlgError
        Where a leading block is singular.
    """
    solve = _recursion()
    if B.ndim == 1:
        return solve(lags, B)[0]
    X = np.empty_like(B)
    for k, b in enumerate(B):  # In a small system `numpy.stack` would be felt.
        X[k] = solve(lags, b)[0]
    return X


@cache
def _recursion() -> Recursion:
    """Return the recursion that SciPy has compiled, if it still is what it was.

    Its public function takes several times as long for some unknowns, to check its arguments. The
    private one may change or vanish with any release, and then the public one is taken.
    """
    lags, b = np.array([0.5, 1.0, 4.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0])
    try:
        from scipy.linalg._solve_toeplitz import levinson as compiled

        for a, right in ((lags, b), (lags * (1.0 + 0.5j), b * 1j)):
            x = compiled(a, right)[0]
            if not np.allclose(np.convolve(a, x, "valid"), right, rtol=1e-12):
                return _public
    except Exception:  # Whatever the reason is, the public function is what it was.
        return _public
    return compiled


def _public(lags: Array, b: Array) -> tuple[Array, None]:
    n = len(b)
    x = scipy.linalg.solve_toeplitz((lags[n - 1 :], lags[n - 1 :: -1]), b, check_finite=False)
    return x, None


def levinson_of_batch(C: Array, B: Array) -> Array:
    """Solve many symmetric systems at once; what has no solution is not finite.

    Parameters
    ----------
    C : ndarray of shape (n, systems)
        The first columns, as columns.
    B : ndarray of shape (n, k, systems)
        k right-hand sides of each.
    """
    n, systems = C.shape
    x = np.zeros_like(B)
    a = np.zeros((n, systems))  # The predictor: A a = (e, 0, …, 0) for the leading block.
    a[0] = 1.0
    e = C[0].copy()
    x[0] = B[0] / e
    for k in range(1, n):
        defect = np.einsum("ks,ks->s", a[:k], C[k:0:-1])
        reflection = defect / e
        a[: k + 1] -= reflection * a[k::-1]
        e -= reflection * defect
        # A times the flipped predictor is (0, …, 0, e).
        flipped = a[k::-1]
        step = np.einsum("ks,kcs->cs", flipped, B[: k + 1]) / e
        x[: k + 1] += step * flipped[:, np.newaxis]
    return x
