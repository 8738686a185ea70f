"""Newton's method for the steady state of rolling, until the areas of stick and slip settle.

The areas are those of `stick_slip`, with K = A - S in the place of A. As K is not symmetric, there
is no energy that each change of the areas should lower (`active_sets`): progress is a smaller
residual.
"""

from collections.abc import Callable

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import Areas, along, make_admissible, size
from toeplitz_mg.contact.tangential.given_loads import Loads, Look, carry, look
from toeplitz_mg.contact.tangential.problem import Problem, State

BETTER = 0.9  # Factor of the least residual so far, below which a new one is progress.

# From what is wrong with tractions in some areas, a change of them, and the iterations it took.
Newton = Callable[[Look, Areas, Array], tuple[Array, int]]


def settle(
    problem: Problem,
    loads: Loads,
    K: Products,
    guess: tuple[Array, Areas],
    newton: Newton,
    patience: int,
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
    newton : callable
        A step of Newton's method while the areas are fixed.
    patience : int
        Changes of the areas without a smaller residual, after which it is given up.

    Returns
    -------
    State
        Its shift is the unknown creepages.
    """
    g, vectors, (q, areas) = problem.g, problem.vectors, guess
    q = carry(problem, loads, areas, q)
    u = K(q) if vectors.count(q) else np.zeros_like(q)
    best, left = np.inf, patience
    iterations: list[int] = []
    while True:
        now = look(problem, loads, areas, q, u)
        left = patience if now.residual < BETTER * best else left - 1
        best = min(best, now.residual)
        if now.residual <= problem.tolerance or K.exhausted or left == 0:
            return State(q, u, areas, now.creepages, now.residual, tuple(iterations))
        K.progress, K.residual = problem.progress, now.residual
        v, count = newton(now, areas, q)
        iterations.append(count)
        q = q + v
        out = areas.stick & (size(q) > g)
        q, _ = make_admissible(q, g, areas, areas.slide | out, None, vectors)
        b = now.b
        if len(loads.wanted):
            stuck = areas.exchange(out, np.zeros_like(out))
            q = carry(problem, loads, stuck, q)
            u = K(q)
            b = look(problem, loads, stuck, q, u).b
        else:
            u = K(q)
        back = areas.slide & (along(b - u, now.law.T.n) < 0.0)
        areas = areas.exchange(out, back)
