"""Newton steps for few elements in contact, with the matrix stored as an array.

Fields contain only the elements in contact and have one axis. The unknowns of the linear systems
are the slip of sliding elements, since the inverse of the matrix is available. They are solved in
single precision, so each step leaves some 1e-6 of the residual.

Bodies that roll start from the leading edge. Here the growth of the tractions is that of bonded
bodies, so the initial guess is exact where nothing slips.
"""

import numpy as np
from scipy.linalg import lapack

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import DenseMatrix
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.law import STIFFEST, Areas, Linearisation, Problem, State, admit
from toeplitz_mg.contact.tangential.loads import Loads, Look
from toeplitz_mg.contact.tangential.settling import settle
from toeplitz_mg.contact.tangential.starts import roll_backwards


def find_directly(
    problem: Problem,
    loads: Loads,
    K: Products,
    array: DenseMatrix,
    guess: tuple[Array, Areas] | None,
    patience: int,
) -> State:
    """Find the state with the matrix K as an array, or as far as the areas converge.

    The other arguments are those of `settling.settle`, on a grid. Without a guess the search starts
    from the leading edge.
    """
    C = problem.g > 0.0
    few = loads.restrict(C)
    on_contact = problem.restrict(C)
    if guess is None:
        q, slide = np.zeros(problem.b.shape), np.zeros(C.shape, bool)
        if not len(loads.wanted):  # For given loads, some elements must stick to carry them.
            q[:, C] = array.solve(on_contact.b.reshape(-1)).reshape(on_contact.b.shape)
            q, slide = roll_backwards(q, problem.g)
        guess = admit(problem, q, slide)
    q, areas = guess
    products = Products(array, K.limit)
    products.count = K.count
    state = settle(
        on_contact,
        few,
        products,
        (np.ascontiguousarray(q[:, C]), Areas(areas.stick[C], areas.slide[C])),
        lambda now, areas, *_: (_newton_step(now, areas, array, few), None, 1),
        patience,
    )
    K.count = products.count
    return state.extend(C)


def _combine(v: Array, arms: Array, wanted: Array) -> Array:
    """Return the first field, plus multiples of the others for the wanted products with arms."""
    first, others = v[0], v[1:]
    if len(wanted):
        # Units differ, and if too little sticks, nothing restores the loads.
        rows, columns = arms.reshape(len(arms), -1), others.reshape(len(others), -1)
        sizes = [np.linalg.norm(x, axis=1) for x in (rows, columns)]
        of_arms, of_others = (np.where(s > 0.0, s, 1.0) for s in sizes)
        system = (rows @ columns.T) / of_arms[:, None] / of_others
        weights = np.linalg.lstsq(system, (wanted - rows @ first.ravel()) / of_arms)[0]
        first = first + np.tensordot(weights / of_others, others, 1)
    return first


def _newton_step(now: Look, areas: Areas, K: DenseMatrix, loads: Loads) -> Array:
    """Return the change of the tractions by Newton's method."""
    law = now.law
    scale = float(np.abs(law.r).max()) or 1.0
    if law.slope is not None:
        v = _solve_with_slope(K, law, np.concatenate([law.r[None], law.of_slip(loads.units)]))
        return _combine(v, loads.arms, now.missing)
    r = np.concatenate([law.r[None] / scale, loads.units])
    stiffness = np.minimum(law.stiffness, STIFFEST * K.array[0, 0])
    # Loads are restored to full accuracy.
    v = solve_on_tangents(K, areas, law.T.n, stiffness, r, precisely=len(loads.wanted) > 0)
    v[0] *= scale
    return _combine(v, loads.arms, now.missing)


def _solve_with_slope(K: DenseMatrix, law: Linearisation, r: Array) -> Array:
    """Return changes of tractions whose magnitude depends on the slip, which remove r."""
    _, components, m = r.shape
    identity = np.eye(components * m).reshape(-1, components, m)
    stiffness = np.minimum(law.stiffness, STIFFEST * K.array[0, 0])
    columns = np.ascontiguousarray(K.array.T).reshape(identity.shape)
    system = law.remove(identity, columns, law.T, np.where(law.T.n.any(axis=0), stiffness, 0.0))
    matrix = system.reshape(len(identity), -1)
    *_, v, fails = lapack.dgesv(matrix.T, r.reshape(len(r), -1).T)
    return np.zeros_like(r) if fails else np.ascontiguousarray(v.T).reshape(r.shape)


def solve_on_tangents(
    K: DenseMatrix, areas: Areas, n: Array, stiffness: Array, r: Array, *, precisely: bool
) -> Array:
    """Return tangents v for which r - (K + λ) v is orthogonal to all tangents.

    Where it sticks, each direction is a tangent; where it slides, the one perpendicular to the
    traction. If the system is singular, the result is no solution, and the areas do not converge.

    Parameters
    ----------
    K, areas
        The matrix for m elements, and where these stick and slide.
    n : ndarray of shape (components, m)
        Directions of the tractions where it slides.
    stiffness : ndarray of shape (m,)
        λ, which is ignored where it sticks.
    r : ndarray of shape (k, components, m)
    precisely : bool
        Whether to solve in double precision.
    """
    inverse, k0 = K.inverse(precisely=precisely), K.array[0, 0]
    slid, m = np.flatnonzero(areas.slide), len(stiffness)
    exact, stiffness = n[:, slid], stiffness[slid]
    n = exact.astype(inverse.dtype)
    r = r.reshape(len(r), -1).astype(inverse.dtype)
    # Find f = r - K v, which is zero where it sticks; then v is K⁻¹ (r - f).
    v = r @ inverse.T
    if not len(slid):
        return v.astype(np.float64).reshape(len(r), len(n), m)
    unknowns = np.concatenate([slid + k * m for k in range(len(n))])
    # Each row has the coefficients of an unknown: gathering rows is faster than gathering columns.
    system = np.ascontiguousarray(inverse.take(unknowns, axis=0).T).take(unknowns, axis=0)
    right, s = v.take(unknowns, axis=1), len(slid)
    if len(n) == 2:
        # Along the traction v is zero; perpendicular to it f = λ v, which is divided by k₀ + λ.
        x, y = n
        share = (stiffness / (k0 + stiffness)).astype(n.dtype)
        for rows in (system, right):
            of_x, of_y = rows[:, :s], rows[:, s:]
            along, across = x * of_x + y * of_y, x * of_y - y * of_x
            rows[:, :s], rows[:, s:] = along, across * share
        k, of_f = np.arange(s), (1.0 - share) / k0
        system[k, k + s] -= y * of_f
        system[k + s, k + s] += x * of_f
    gesv = lapack.sgesv if system.dtype == np.float32 else lapack.dgesv
    f = gesv(system.T, right.T, overwrite_a=True, overwrite_b=True)[2].T
    r[:, unknowns] -= f
    v = r @ inverse.T
    if len(n) == 2:
        # Where λ is large, v loses its digits by cancellation; f/λ is accurate.
        across = x * f[:, s:] - y * f[:, :s], x * v[:, slid + m] - y * v[:, slid]
        turns = np.where(stiffness > k0, across[0] / np.maximum(stiffness, k0), across[1])
        v[:, slid], v[:, slid + m] = -y * turns, x * turns
    v = v.astype(np.float64).reshape(len(r), len(n), m)
    # Remove rounding errors along the tractions.
    v[..., slid] -= exact * (exact * v[..., slid]).sum(axis=1)[:, None]
    return v
