"""Which of some preconditioners is better than none, by a few steps of conjugate gradients."""

from collections.abc import Sequence
from functools import partial
from math import inf, log

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.vectors import axpy, norm
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.positivity import INDEFINITE

# With 10 steps, or a smaller advantage, wide covariances and plane waves mislead: the choice is
# then worse than none.
STEPS = 20  # Most steps of conjugate gradients in a trial: each costs as much as an iteration.
ADVANTAGE = 2.0  # Least quotient of the residual without a preconditioner and that with it.
MOSTLY_ROUNDING = 1e-8  # Relative residual at which a trial ends: further falls may be rounding.


def better_than_none(
    A: LinearOperator, none: LinearOperator, others: Sequence[LinearOperator]
) -> LinearOperator:
    """Return the preconditioner that reduces the residual the most, or else `none`.

    Parameters
    ----------
    A : LinearOperator
        Symmetric or Hermitian positive definite.
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
    noise = np.random.default_rng(0).standard_normal((2, n))
    random = noise[0] + 1j * noise[1] if np.dtype(A.dtype).kind == "c" else noise[0]
    rhs = [b.astype(A.dtype) for b in (np.ones(n), random)]
    without = [_fall(A, none, b) for b in rhs]
    best, most = none, log(ADVANTAGE)
    for M in others:
        falls = (_fall(A, M, b) for b in rhs)
        gain = min(fall - other for fall, other in zip(falls, without, strict=True))
        if gain > most:
            best, most = M, gain
    return best


def _fall(A: LinearOperator, M: LinearOperator, b: Array) -> float:
    """Return log ‖b‖/‖r‖ for the least residual r of all steps; -inf if M is not positive.

    Where fewer steps solve the system, it is what all of them would give at that rate.
    """
    iteration = ConjugateGradients(partial(apply_to_rows, A), partial(apply_to_rows, M))
    size = least = norm(b)
    r = b.copy()
    for steps in range(1, STEPS + 1):
        length = iteration.step(r)
        if not iteration.rho > 0.0:
            return -inf
        if length == 0.0:
            raise np.linalg.LinAlgError(
                f"A is not positive definite: for some vector xᴴ A x is "
                f"{iteration.curvature:.3g}: use {INDEFINITE}"
            )
        axpy(-length, iteration.product, r)
        least = min(least, norm(r))
        if least <= MOSTLY_ROUNDING * size:
            least = max(least, np.finfo(np.float64).eps * size)
            return log(size / least) * STEPS / steps
    return log(size / least)
