"""GMRES, preconditioned from the right: one product in an iteration, and none beside."""

from collections.abc import Callable

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import combined, dot, dots

TWICE = 0.5  # of the size is lost, and with it digits: what is left is made orthogonal again


def gmres(
    A: Callable[[Array], Array],
    M: Callable[[Array], Array],
    b: Array,
    goal: Callable[[Array], float],
    most: int,
    dtype: DTypeLike,
) -> tuple[Array, int]:
    """Solve A x = b, and return x and the number of iterations.

    Parameters
    ----------
    A, M : callable
        Products of fields with the matrix, and with an approximate inverse.
    b : ndarray
        Not zero.
    goal : callable
        What of ‖b - A x‖₂ may be left for the iterate x.
    most : int
        Iterations at most.
    dtype : float32 or float64
        Of the fields that A and M are given, all of which are kept.
    """
    beta = np.sqrt(dot(b, b))
    basis, directions = np.empty((most + 1, *b.shape), dtype), np.empty((most, *b.shape), dtype)
    basis[0] = b / beta
    H, rhs = np.zeros((most + 1, most)), np.zeros(most + 1)
    rhs[0] = 1.0
    for k in range(most):
        directions[k] = M(basis[k])
        w = A(directions[k]).astype(dtype, copy=False)
        size, before = np.sqrt(dot(w, w)), np.inf
        while size < TWICE * before:
            h = dots(basis[: k + 1], w)
            w -= combined(h, basis[: k + 1])
            H[: k + 1, k] += h
            size, before = np.sqrt(dot(w, w)), size
        H[k + 1, k] = size
        y, *_ = np.linalg.lstsq(H[: k + 2, : k + 1], rhs[: k + 2])
        left = float(np.linalg.norm(rhs[: k + 2] - H[: k + 2, : k + 1] @ y))
        x = beta * combined(y, directions[: k + 1]).astype(np.float64)
        if left * beta <= goal(x) or size <= 1e-14:
            break
        basis[k + 1] = w / size
    return x, k + 1
