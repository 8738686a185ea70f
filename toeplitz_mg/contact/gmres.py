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
    basis: list[Array] = [b / beta]
    directions: list[Array] = []
    H, rhs = np.zeros((most + 1, most)), np.zeros(most + 1)
    rhs[0] = beta
    while True:
        k = len(directions)
        directions.append(M(basis[k]))
        w = A(directions[k])
        for j, q in enumerate(basis):
            H[j, k] = np.vdot(q, w)
            w = w - H[j, k] * q
        H[k + 1, k] = np.linalg.norm(w)
        y, *_ = np.linalg.lstsq(H[: k + 2, : k + 1], rhs[: k + 2])
        left = float(np.linalg.norm(rhs[: k + 2] - H[: k + 2, : k + 1] @ y))
        x = sum(c * d for c, d in zip(y, directions, strict=True))
        if left <= goal(np.asarray(x)) or k + 1 == most or H[k + 1, k] <= 1e-14 * beta:
            return np.asarray(x), k + 1
        basis.append(w / H[k + 1, k])
