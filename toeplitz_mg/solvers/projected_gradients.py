"""Projected gradients: slow, but they always descend. They help where sets of elements cycle."""

from collections.abc import Callable

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import dot


def descend(
    A: Callable[[Array], Array],
    b: Array,
    x: Array,
    project: Callable[[Array], Array],
    norm: float,
    products: int,
) -> tuple[Array, Array]:
    """Lower the energy ½ x·Ax - b·x of admissible tractions by Nesterov's method.

    Parameters
    ----------
    A : callable
        Products, with a symmetric positive matrix.
    b, x : ndarray
        `x` is admissible.
    project : callable
        Returns the admissible tractions nearest to any.
    norm : float
        At least the largest eigenvalue of A.
    products : int
        To be made, about.

    Returns
    -------
    x, Ax : ndarray
        The iterate of the lowest energy.

    References
    ----------
    A. Beck, M. Teboulle, A fast iterative shrinkage-thresholding algorithm, SIAM J. Imaging Sci. 2
    (2009); B. O'Donoghue, E. Candès, Adaptive restart for accelerated gradient schemes, Found.
    Comput. Math. 15 (2015).
    """
    u = A(x)
    best, lowest = (x, u), _energy(x, u, b)
    y, Ay, t = x, u, 1.0
    for _ in range(products):
        new = project(y + (b - Ay) / norm)
        new_u = A(new)
        if dot(y - new, new - x) > 0.0:  # uphill: forget the momentum
            t = 1.0
        following = (1.0 + np.sqrt(1.0 + 4.0 * t * t)) / 2.0
        momentum = (t - 1.0) / following
        y, Ay = new + momentum * (new - x), new_u + momentum * (new_u - u)
        x, u, t = new, new_u, following
        energy = _energy(x, u, b)
        if energy < lowest:
            best, lowest = (x, u), energy
    return best


def _energy(x: Array, u: Array, b: Array) -> float:
    return dot(x, 0.5 * u - b)
