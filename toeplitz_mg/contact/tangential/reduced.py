"""The linear systems of Newton's method with the matrix as an array, in the fewest unknowns.

Where elements stick no slip may be left, and where they slide the tractions may only turn. So the
unknowns are the changes of the tractions, two where it sticks and one where it slides; or else, as
the inverse of the matrix is at hand, the slip that may be left: two where it slides.
"""

import numpy as np
from scipy.linalg import lapack

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.steady_matrices import SteadyArray
from toeplitz_mg.contact.tangential.coulomb import Areas


def solve_on_tangents(
    K: SteadyArray, areas: Areas, n: Array, stiffness: Array, r: Array, *, precisely: bool
) -> Array:
    """Return tangents v for which r - (K + λ) v is orthogonal to all tangents.

    Parameters
    ----------
    K : SteadyArray
        The matrix of m elements.
    areas : Areas
        Each direction is a tangent where it sticks, the one across the traction where it slides.
    n : ndarray of shape (components, m)
        The directions of the tractions where it slides.
    stiffness : ndarray of shape (m,)
        λ, which is of no matter where it sticks.
    r : ndarray of shape (k, components, m)
    precisely : bool
        Whether to solve in double precision.

    Returns
    -------
    ndarray of shape (k, components, m)
        It is no solution where the system is singular: then the areas do not settle.
    """
    stuck, slid = np.flatnonzero(areas.stick), np.flatnonzero(areas.slide)
    for_slip = len(slid) < len(n) * len(stuck)  # Then it has fewer unknowns.
    matrix = K.choose(inverse=for_slip, precisely=precisely)
    directions, own = n[:, slid].astype(matrix.dtype), stiffness[slid]
    fields = r.reshape(len(r), -1).astype(matrix.dtype)
    if for_slip:
        v = _solve_for_slip(matrix, K.array[0, 0], slid, directions, own, fields)
    else:
        v = _solve_for_tractions(matrix, stuck, slid, directions, own, fields)
    v = v.astype(np.float64).reshape(r.shape)
    # What rounding leaves along the tractions is taken out.
    v[..., slid] -= n[:, slid] * (n[:, slid] * v[..., slid]).sum(axis=1)[:, None]
    return v


def _solve_for_slip(
    inverse: Array, k0: float, slid: Array, n: Array, stiffness: Array, r: Array
) -> Array:
    """Find f = r - K v, which is zero where it sticks: then v is K⁻¹ (r - f)."""
    v = r @ inverse.T
    if not len(slid):
        return v
    s, m = len(slid), len(inverse) // len(n)
    unknowns = np.concatenate([slid + k * m for k in range(len(n))])
    # Each row has the coefficients of an unknown. Rows are gathered fast, columns are not.
    system = np.ascontiguousarray(inverse.take(unknowns, axis=0).T).take(unknowns, axis=0)
    right = v.take(unknowns, axis=1)
    if len(n) == 2:
        # Along the traction v is zero, and across it f = λ v, which is divided by k₀ + λ.
        x, y = n
        share = (stiffness / (k0 + stiffness)).astype(n.dtype)
        for rows in (system, right):
            of_x, of_y = rows[:, :s], rows[:, s:]
            along, across = x * of_x + y * of_y, x * of_y - y * of_x
            rows[:, :s], rows[:, s:] = along, across * share
        k, of_f = np.arange(s), (1.0 - share) / k0
        system[k, k + s] -= y * of_f
        system[k + s, k + s] += x * of_f
    f = _solve(system, right)
    r[:, unknowns] -= f
    v = r @ inverse.T
    if len(n) == 2:
        # Where λ is large what is left of v by cancellation is rounding: there it is f/λ.
        along_y = slid + m
        across = x * f[:, s:] - y * f[:, :s], x * v[:, along_y] - y * v[:, slid]
        turns = np.where(stiffness > k0, across[0] / np.maximum(stiffness, k0), across[1])
        v[:, slid], v[:, along_y] = -y * turns, x * turns
    return v


def _solve_for_tractions(
    matrix: Array, stuck: Array, slid: Array, n: Array, stiffness: Array, r: Array
) -> Array:
    """Find v by its coordinates in a basis of the tangents."""
    m = len(matrix) // len(n)
    stuck = np.concatenate([stuck + k * m for k in range(len(n))])
    slid, (x, y) = (slid, n) if len(n) == 2 else (slid[:0], np.empty((2, 0), n.dtype))
    x, y = x[:, None], y[:, None]
    bound = len(stuck)

    def project(fields: Array) -> Array:
        parts = np.empty((bound + len(slid), fields.shape[1]), fields.dtype)
        fields.take(stuck, axis=0, out=parts[:bound], mode="clip")
        parts[bound:] = x * fields.take(slid + m, axis=0) - y * fields.take(slid, axis=0)
        return parts

    v = np.zeros_like(r)
    system = project(np.ascontiguousarray(project(matrix).T))
    if not len(system):
        return v
    system.ravel()[:: len(system) + 1][bound:] += stiffness[: len(slid)]
    weights = _solve(system, project(r.T).T)
    v[:, stuck], turns = weights[:, :bound], weights[:, bound:]
    v[:, slid], v[:, slid + m] = -y[:, 0] * turns, x[:, 0] * turns
    return v


def _solve(rows: Array, right: Array) -> Array:
    """Return the solutions, as rows, of a system whose transpose this is, which is overwritten."""
    gesv = lapack.sgesv if rows.dtype == np.float32 else lapack.dgesv
    *_, solutions, _ = gesv(rows.T, right.T, overwrite_a=True, overwrite_b=True)
    result: Array = solutions.T
    return result
