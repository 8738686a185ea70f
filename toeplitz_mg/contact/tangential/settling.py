"""Changes of tractions and areas, until stick and slip settle in the steady state of rolling.

The areas are those of `stick_slip`, with K = A - S in the place of A. As K is not symmetric, there
is no energy that each change of the areas should lower (`active_sets`): progress is a smaller
residual.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Displacements, Products
from toeplitz_mg.contact.tangential.coulomb import Areas, along, make_admissible, size
from toeplitz_mg.contact.tangential.given_loads import (
    Loads,
    Look,
    carry,
    find_displacements,
    look,
)
from toeplitz_mg.contact.tangential.problem import Problem, State

EXACT = 0.1  # Part of the tolerance by which displacements in the end may be off.
HOPE = 5  # Steps without progress, after which each is made in part only.
DAMPED = 0.5  # That part.
BETTER = 0.9  # Factor of the least residual so far, below which a new one is progress.

# From what is wrong with tractions in some areas, these, and their displacements, a change of them.
Step = Callable[[Look, Areas, Array, Array], Array]


def settle(
    problem: Problem,
    loads: Loads,
    K: Products,
    guess: tuple[Array, Areas],
    step: Step,
    patience: int,
    dtype: DTypeLike = np.float64,
) -> State:
    """Change tractions and areas until they obey Coulomb's law, or are no better for long.

    Parameters
    ----------
    problem : Problem
    loads : Loads
        The loads that are given in the place of creepages.
    K : Products
        Products with A - S.
    guess : (ndarray, Areas)
        Admissible tractions and areas.
    step : callable
        A change of the tractions, as if the areas were fixed.
    patience : int
        Changes of the areas without a smaller residual, after which it is given up.
    dtype : float32 or float64
        The precision of products with changes of the tractions.

    Returns
    -------
    State
        Its shift is the unknown creepages.
    """
    g, vectors, (q, areas) = problem.g, problem.vectors, guess
    q = carry(problem, loads, areas, q)
    displacements = Displacements(K, q, dtype)
    best, left, steps = None, patience, 0
    while True:
        now = look(problem, loads, areas, q, displacements.u)
        allowed = EXACT * problem.tolerance * now.law.scale
        if now.residual <= problem.tolerance and displacements.lost > allowed and not K.exhausted:
            displacements.renew()
            continue
        left = patience if best is None or now.residual < BETTER * best.residual else left - 1
        state = State(q, displacements.u, areas, now.creepages, now.residual, (steps,))
        if best is None or state.residual < best.residual:
            best = state
        if K.exhausted:  # It is the last search.
            return replace(best, iterations=(steps,))
        if now.residual <= problem.tolerance or left == 0:
            return state
        K.progress, K.residual = problem.progress, now.residual
        change = now.residual * now.law.scale
        v = step(now, areas, q, displacements.u)
        # Whole steps may go round in a circle, where elements turn out wrong in either area.
        q = q + (v if left > patience - HOPE else DAMPED * v)
        steps += 1
        out = areas.stick & (size(q) > g)
        q, _ = make_admissible(q, g, areas, areas.slide | out, None, vectors)
        b = now.b
        if len(loads.wanted):
            stuck = areas.exchange(out, np.zeros_like(out))
            q = carry(problem, loads, stuck, q)
            displacements.follow(q, change, allowed)
            b = find_displacements(problem, loads, stuck, q, displacements.u)
        else:
            displacements.follow(q, change, allowed)
        back = areas.slide & (along(b - displacements.u, now.law.T.n) < 0.0)
        areas = areas.exchange(out, back)
