"""Projected gradients, which always decrease the energy: slow, but useful if sets cycle."""

from collections.abc import Callable
from math import sqrt

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import VECTORS, Vectors


def descend(
    A: Callable[[Array], Array],
    b: Array,
    x: Array,
    project: Callable[[Array], Array],
    norm_bound: float,
    products: int,
    vectors: Vectors = VECTORS,
) -> tuple[Array, Array]:
    """Decrease the energy ½ x·Ax - b·x within a convex set, by Nesterov's method.

    It starts from a point x of the set, makes one product and `products` more, and returns the
    iterate with the lowest energy, and its product. `project` returns the nearest point of the set.
    `norm_bound` is at least the largest eigenvalue of A, which is positive definite.

    References
    ----------
    A. Beck, M. Teboulle, A fast iterative shrinkage-thresholding algorithm, SIAM J. Imaging Sci. 2
    (2009); B. O'Donoghue, E. Candès, Adaptive restart for accelerated gradient schemes, Found.
    Comput. Math. 15 (2015).

    Examples
    --------
    >>> import numpy as np
    >>> A, b = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([2.0, -1.0])
    >>> x, _ = descend(lambda x: A @ x, b, np.zeros(2), lambda x: np.maximum(x, 0.0), 3.0, 60)
    >>> x.round(6)
    array([1., 0.])
    """
    u = A(x)
    best, lowest = (x, u), energy(x, u, b, vectors)
    y, Ay, t = x, u, 1.0
    for _ in range(products):
        new = project(y + (b - Ay) / norm_bound)
        new_u = A(new)
        if vectors.dot(y - new, new - x) > 0.0:  # It went uphill: reset the momentum.
            t = 1.0
        following = (1.0 + sqrt(1.0 + 4.0 * t * t)) / 2.0
        momentum = (t - 1.0) / following
        y, Ay = new + momentum * (new - x), new_u + momentum * (new_u - u)
        x, u, t = new, new_u, following
        reached = energy(x, u, b, vectors)
        if reached < lowest:
            best, lowest = (x, u), reached
    return best


def energy(x: Array, u: Array, b: Array, vectors: Vectors) -> float:
    """Return ½ x·Ax - b·x, where u = A x."""
    return vectors.dot(x, vectors.elementwise(lambda u, b: 0.5 * u - b, u, b))
