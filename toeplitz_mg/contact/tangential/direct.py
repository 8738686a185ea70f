"""Steady rolling of few elements: Newton's method with the matrix as an array.

The search knows the elements in contact only, as one axis. Its linear systems are solved in single
precision, which leaves a part of some 1e-6 of each to the next one.

It starts from the leading edge. The growth of the tractions is that of bonded bodies here, so that
the start is exact where nothing slips.
"""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.steady_matrices import SteadyArray
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.given_loads import Loads, Look
from toeplitz_mg.contact.tangential.leading_edge import roll_backwards
from toeplitz_mg.contact.tangential.problem import STIFFEST, Problem, State, admit
from toeplitz_mg.contact.tangential.reduced import solve_on_tangents
from toeplitz_mg.contact.tangential.settling import settle


def find_directly(
    problem: Problem,
    loads: Loads,
    K: Products,
    array: SteadyArray,
    guess: tuple[Array, Areas] | None,
    patience: int,
) -> State:
    """Find the steady state from the matrix as an array, or how far the areas settle.

    Parameters
    ----------
    problem, loads, K, patience
        The arguments of `settling.settle`, on a grid.
    array : SteadyArray
        The matrix K of the elements in contact.
    guess : (ndarray, Areas), optional
        Admissible tractions and areas; by default those from the leading edge backwards.
    """
    C = problem.g > 0.0
    few = Loads(loads.units[..., C], loads.arms[..., C], loads.wanted)
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
        lambda now, areas, *_: _newton_step(now, areas, array, few),
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


def _newton_step(now: Look, areas: Areas, K: SteadyArray, loads: Loads) -> Array:
    """Return the change of the tractions by Newton's method."""
    law = now.law
    scale = float(np.abs(law.r).max()) or 1.0
    r = np.concatenate([law.r[None] / scale, loads.units])
    stiffness = np.minimum(law.stiffness, STIFFEST * K.array[0, 0])
    # Loads are to be restored to their last digit.
    v = solve_on_tangents(K, areas, law.T.n, stiffness, r, precisely=len(loads.wanted) > 0)
    v[0] *= scale
    return _combine(v, loads.arms, now.missing)
