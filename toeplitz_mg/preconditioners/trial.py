"""Which of some preconditioners is better than none, by a few steps of conjugate gradients."""

from collections.abc import Iterator, Sequence
from math import log

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import apply_to_rows

# As `python -m comparisons.default_choice` measures them, by the cases that are worse than none:
# in 10 steps, and with less of an advantage, wide covariances and plane waves mislead.
STEPS = 20  # of conjugate gradients, at most: their cost is that of as many iterations
ADVANTAGE = 2.0  # by which a residual must be less than that without a preconditioner
SOLVED = 1e-8  # relative residual at which a trial ends


def better_than_none(
    A: LinearOperator, none: LinearOperator, others: Sequence[LinearOperator]
) -> LinearOperator:
    """Return the preconditioner that reduces the residual the most, or else `none`.

    Parameters
    ----------
    A : LinearOperator
        Symmetric positive definite.
    none : LinearOperator
        A multiple of the unit matrix.
    others : sequence of LinearOperator

    Returns
    -------
    LinearOperator
        One of `others` only where it is better for a right-hand side that is constant, and for
        one that is random.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where A is found not to be positive definite.
    """
    n = A.shape[0]
    rhs = np.ones(n), np.random.default_rng(0).standard_normal(n)
    without = [_fall(A, none, b.astype(A.dtype)) for b in rhs]
    best, most = none, log(ADVANTAGE)
    for M in others:
        falls = (_fall(A, M, b.astype(A.dtype)) for b in rhs)
        gain = min(fall - other for fall, other in zip(falls, without, strict=True))
        if gain > most:
            best, most = M, gain
    return best


def _fall(A: LinearOperator, M: LinearOperator, b: Array) -> float:
    """Return log ‖b‖/‖r‖ for the least residual r in so many steps; -inf if M is not positive.

    Where it is solved for in fewer steps, what all of them would give at that rate.
    """
    size = float(np.linalg.norm(b))
    least = size
    for steps, residual in enumerate(_residuals(A, M, b), 1):
        least = min(least, residual)
        if least <= SOLVED * size:
            least = max(least, np.finfo(np.float64).eps * size)
            return log(size / least) * STEPS / steps
        if steps == STEPS:
            return log(size / least)
    return -np.inf


def _residuals(A: LinearOperator, M: LinearOperator, b: Array) -> Iterator[float]:
    """Yield the norms of the residuals of conjugate gradients, as long as M is positive."""
    r, p, before = b.copy(), np.zeros_like(b), 1.0
    while (rho := float(r @ (z := apply_to_rows(M, r)))) > 0.0:
        p = z + (rho / before) * p
        q = apply_to_rows(A, p)
        curvature = float(p @ q)
        if not curvature > 0.0:
            raise np.linalg.LinAlgError(
                f"A is not positive definite: for some vector xᵀ A x is {curvature:.3g}"
            )
        r -= (rho / curvature) * q
        before = rho
        yield float(np.linalg.norm(r))
