"""GMRES, preconditioned from the right: one product in an iteration, and none beside."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def gmres(
    A: Callable[[Array], Array],
    M: Callable[[Array], Array],
    b: Array,
    goal: Callable[[Array], float],
    most: int,
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
    """
    beta = float(np.linalg.norm(b))
    # In one array each, for few large products: many small ones keep the threads of BLAS waiting.
    basis, directions = np.empty((most + 1, b.size)), np.empty((most, b.size))
    basis[0] = b.reshape(-1) / beta
    H, rhs = np.zeros((most + 1, most)), np.zeros(most + 1)
    rhs[0] = beta
    for k in range(most):
        direction = M(basis[k].reshape(b.shape))
        directions[k] = direction.reshape(-1)
        w = A(direction).reshape(-1)
        for _ in range(2):  # once does not make it orthogonal to rounding
            h = basis[: k + 1] @ w
            w = w - h @ basis[: k + 1]
            H[: k + 1, k] += h
        H[k + 1, k] = np.linalg.norm(w)
        y, *_ = np.linalg.lstsq(H[: k + 2, : k + 1], rhs[: k + 2])
        left = float(np.linalg.norm(rhs[: k + 2] - H[: k + 2, : k + 1] @ y))
        x = (y @ directions[: k + 1]).reshape(b.shape)
        if left <= goal(x) or H[k + 1, k] <= 1e-14 * beta:
            break
        basis[k + 1] = w / H[k + 1, k]
    return x, k + 1
