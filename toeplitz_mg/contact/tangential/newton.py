"""Steps of Newton's method where the elements in contact are few, and the matrix is an array.

The search knows the elements in contact only, as one axis. The unknowns of its linear systems are
the changes of the tractions: all components where an element sticks, and one where it slides. They
are solved in single precision, which leaves a part of some 1e-6 of each to the next one.

Bodies that roll start from the leading edge. The growth of the tractions is that of bonded bodies
here, so that the start is exact where nothing slips.
"""

import numpy as np
from scipy.linalg import lapack

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import DenseMatrix
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.given_loads import Loads, Look
from toeplitz_mg.contact.tangential.leading_edge import roll_backwards
from toeplitz_mg.contact.tangential.problem import STIFFEST, Problem, State, admit
from toeplitz_mg.contact.tangential.settling import settle


def find_directly(
    problem: Problem,
    loads: Loads,
    K: Products,
    array: DenseMatrix,
    guess: tuple[Array, Areas] | None,
    patience: int,
) -> State:
    """Find the steady state from the matrix as an array, or how far the areas settle.

    Parameters
    ----------
    problem, loads, K, patience
        The arguments of `settling.settle`, on a grid.
    array : DenseMatrix
        The matrix K of the elements in contact.
    guess : (ndarray, Areas), optional
        Admissible tractions and areas; by default those from the leading edge backwards.
    """
    C = problem.g > 0.0
    few = loads.restrict(C)
    on_contact = problem.restrict(C)
    if guess is None:
        q, slide = np.zeros(problem.b.shape), np.zeros(C.shape, bool)
        if not len(loads.wanted):  # Where loads are given, something must stick to carry them.
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
    """Return the first field, and of the others what makes its products with arms as wanted."""
    first, others = v[0], v[1:]
    if len(wanted):
        # Units differ, and where too little sticks nothing restores the loads.
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
    r = np.concatenate([law.r[None] / scale, loads.units])
    stiffness = np.minimum(law.stiffness, STIFFEST * K.array[0, 0])
    # Loads are to be restored to their last digit.
    v = solve_on_tangents(K, areas, law.T.n, stiffness, r, precisely=len(loads.wanted) > 0)
    v[0] *= scale
    return _combine(v, loads.arms, now.missing)


def solve_on_tangents(
    K: DenseMatrix, areas: Areas, n: Array, stiffness: Array, r: Array, *, precisely: bool
) -> Array:
    """Return tangents v for which r - (K + λ) v is orthogonal to all tangents.

    Parameters
    ----------
    K : DenseMatrix
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
    matrix = K.array if precisely else K.rough
    m, components = len(stiffness), len(n)
    stuck, slid = np.flatnonzero(areas.stick), np.flatnonzero(areas.slide)
    if components == 1:
        slid = slid[:0]  # There the tractions cannot turn.
    stuck = np.concatenate([stuck + k * m for k in range(components)])
    x, y = n[:, slid, None].astype(matrix.dtype) if len(slid) else np.zeros((2, 0, 1), matrix.dtype)
    bound = len(stuck)

    def project(fields: Array) -> Array:
        parts = np.empty((bound + len(slid), fields.shape[1]), fields.dtype)
        fields.take(stuck, axis=0, out=parts[:bound], mode="clip")
        if len(slid):
            parts[bound:] = x * fields.take(slid + m, axis=0) - y * fields.take(slid, axis=0)
        return parts

    fields = r.reshape(len(r), -1).astype(matrix.dtype)
    v = np.zeros_like(fields)
    # The rows of the transposed system: LAPACK wants the columns of the system one by one.
    system = project(np.ascontiguousarray(project(matrix).T))
    if len(system):
        system.ravel()[:: len(system) + 1][bound:] += stiffness[slid]
        gesv = lapack.sgesv if matrix.dtype == np.float32 else lapack.dgesv
        right = project(fields.T)
        *_, weights, _ = gesv(system.T, right, overwrite_a=True, overwrite_b=True)
        v[:, stuck], turns = weights[:bound].T, weights[bound:].T
        if len(slid):
            v[:, slid], v[:, slid + m] = -y[:, 0] * turns, x[:, 0] * turns
    v = v.astype(np.float64).reshape(r.shape)
    # What rounding leaves along the tractions is taken out.
    v[..., slid] -= n[:, slid] * (n[:, slid] * v[..., slid]).sum(axis=1)[:, None]
    return v
