"""Contact of nearly all elements on a surface that repeats: gap and pressure exchange their roles.

There a gap w after pressing takes the pressures p = P + K (w - z), where P is their mean, which the
force gives, and K the inverse of A, but for the mean. So the conditions w ≥ 0, p ≥ 0, w p = 0 have
the form of contact again: with the matrix K, the gap -K z before and the approach -P, w are the
"pressures" and p is the "gap". What is "in contact" then are the few elements that are apart.
"""

from math import prod

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.active_sets import find_sets
from toeplitz_mg.contact.normal.active_set import Search
from toeplitz_mg.contact.products import Products

PART = 0.5  # Part of the tolerance that is left to the exchange.
# Force over its deviation in full contact beyond which few elements are pulled apart: a tenth of
# them where the pressures are normally distributed.
FULL = 1.28


def press_all_but_few(
    search: Search, A: Products, eta: float
) -> tuple[Array | None, tuple[int, ...]]:
    """Find the pressures, to the tolerance or nearly so, where few elements are apart.

    Parameters
    ----------
    search : Search
    A : Products
        With its matrix. Products with K count as such.
    eta : float
        The misfit that is left on the first sets (see `active_sets.find_sets`).

    Returns
    -------
    p : ndarray or None
        None where many elements are apart, or the exchange is not possible.
    iterations : tuple of int
        Those on the sets of elements that are apart.
    """
    grid, z, vectors = search.grid, search.z, search.grid.vectors
    is_free = search.hardness == np.inf and grid.has_free_mean
    if search.force is None or not is_free or search.inverse.dtype != np.float32:
        return None, ()
    if search.force < FULL * vary_by(search):
        return None, ()
    K, scale = grid.scaled_inverse()
    products, scale = Products(K, A.limit - A.count), -scale * search.unit
    approach = -search.total / prod(grid.shape)
    z = products(z) * scale
    roles = (K, A.A.astype(np.float32))
    tolerance = search.tolerance
    depth = approach - vectors.min(z)
    if depth > 0.0:
        # A wrong pressure moves its element by about as much, and the interference is the mean gap.
        tolerance *= PART * vectors.sum(search.z) / (prod(grid.shape) * depth)
    other = Search(grid, z, approach, None, tolerance, search.progress, exchanged=roles)
    w, C = np.zeros(z.shape), z < approach
    now, _, iterations = find_sets(
        other,
        products,
        w,
        C,
        b=approach - z,
        eta=eta,
        tolerance=tolerance,
        progress=search.progress,
    )
    A.count += products.count
    return np.where(now.x > 0.0, 0.0, np.maximum(now.u + z - approach, 0.0)), iterations


def vary_by(search: Search) -> float:
    """Return how much full contact varies the force, by the root mean square of its pressures.

    These are E*|q|/2 of a wave with a wavenumber q, and so E*/2 of its slopes. Where the pressures
    vary by more than their mean, those of many elements pull.
    """
    grid, z = search.grid, search.z
    slopes = (np.diff(z, axis=axis) / h for axis, h in enumerate(grid.element))
    squares = sum(grid.vectors.dot(slope, slope) for slope in slopes) / z.size
    return float(0.5 * grid.material.E_star * np.sqrt(squares) * grid.area * z.size)
