"""GMRES, preconditioned from the right: one product in an iteration, and none beside."""

from collections.abc import Callable

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import combine, dots, norm

CANCELLED = 0.5  # Part of a vector's size that may be left before it is made orthogonal again.
EXHAUSTED = 1e-14  # Size of a new basis vector that is rounding: the space holds the solution.


def gmres(
    A: Callable[[Array], Array],
    M: Callable[[Array], Array],
    b: Array,
    goal: Callable[[Array], float],
    max_iterations: int,
    dtype: DTypeLike,
) -> tuple[Array, int]:
    """Solve A x = b by GMRES, with A M in the place of A.

    Parameters
    ----------
    A, M : callable
        Products of a field with the matrix, and with an approximation of its inverse.
    b : ndarray
        A field of any shape, not zero.
    goal : callable
        Called with each iterate x; ‖b - A x‖₂ may be as large as what it returns.
    max_iterations : int
    dtype : float32 or float64
        The precision of the fields that `A` and `M` are given, and of the two bases, which are
        kept: 2 `max_iterations` fields.

    Returns
    -------
    x : ndarray of the shape of `b`, float64
    iterations : int

    References
    ----------
    Y. Saad, M. H. Schultz, GMRES: a generalized minimal residual algorithm for solving
    nonsymmetric linear systems, SIAM J. Sci. Stat. Comput. 7 (1986).

    Examples
    --------
    >>> A = np.array([[2.0, 1.0], [0.0, 1.0]])
    >>> b = np.array([3.0, 1.0])
    >>> x, iterations = gmres(lambda x: A @ x, lambda x: x, b, lambda x: 1e-12, 2, np.float64)
    >>> x.round(12), iterations
    (array([1., 1.]), 2)
    """
    beta = norm(b)
    basis = np.empty((max_iterations + 1, *b.shape), dtype)
    directions = np.empty((max_iterations, *b.shape), dtype)
    basis[0] = b / beta
    H, rhs = np.zeros((max_iterations + 1, max_iterations)), np.zeros(max_iterations + 1)
    rhs[0] = 1.0
    for k in range(max_iterations):
        directions[k] = M(basis[k])
        w = A(directions[k]).astype(dtype)
        size, before = norm(w), np.inf
        while size < CANCELLED * before:
            h = dots(basis[: k + 1], w)
            w -= combine(h, basis[: k + 1])
            H[: k + 1, k] += h
            size, before = norm(w), size
        H[k + 1, k] = size
        y, *_ = np.linalg.lstsq(H[: k + 2, : k + 1], rhs[: k + 2])
        residual = beta * float(np.linalg.norm(rhs[: k + 2] - H[: k + 2, : k + 1] @ y))
        x = beta * combine(y, directions[: k + 1]).astype(np.float64)
        if residual <= goal(x) or size <= EXHAUSTED:
            break
        basis[k + 1] = w / size
    return x, k + 1
