"""The stiffness of a contact: how much the force grows with the approach.

While the elements in contact are the same, a change dδ of the approach changes the pressures by
x dδ, with A x = 1 on them; and which elements they are changes the force to second order only.
"""

from math import prod

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.products import Products
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients

REDUCTION = 1e-4  # Of the residual: that of the stiffness is about its square.
MOST = 200  # Iterations, after which rounding keeps them from the rest.


def find_stiffness(grid: Grid, C: Array) -> float:
    """Return dF/dδ of the elements C in contact, N/mm; in plane strain N/mm².

    The function 2 Σx - x·Ax is largest, and the sum of x, where A x = 1. Near there its error is
    of second order, so that x in single precision is good enough.
    """
    vectors = grid.vectors
    touching = vectors.count(C)
    if not touching:
        return 0.0
    if grid.has_free_mean and touching == prod(grid.shape):
        return np.inf  # A mean pressure moves nothing.
    A, unit = grid.scaled_normal()
    M = Inverse(grid, A)
    M.fit(C, is_near=True)
    products, r = Products(A, MOST), C.astype(M.dtype)
    x = np.zeros_like(r)
    iteration = ConjugateGradients(
        lambda d, out: np.multiply(products(d, out), C, out=out),
        lambda r, out: np.multiply(M(r), C, out=out),
        vectors,
    )
    while not products.exhausted and vectors.max(np.abs(r)) > REDUCTION:
        length = iteration.step(r)
        if length == 0.0:
            break
        x = vectors.axpy(length, iteration.direction, x)
        r = vectors.axpy(-length, iteration.product, r)
    y = x.astype(np.float64)
    return (2.0 * vectors.sum(y) - vectors.dot(y, products(y))) * grid.area / unit
