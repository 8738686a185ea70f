"""The search for the areas of stick and slip, for bodies that are shifted or roll.

Elements stick or slide. While the two sets are fixed, Newton's method linearises Coulomb's law: on
a sliding element the traction moves along the circle |q| = g, and the slip resists with λ = |s|/g,
so that a step v of the tractions solves

    Tᵀ (K + Λ) T v = Tᵀ (b - K q)

with the tangent vectors T. Each step is solved as accurately as the sets are known, then the sets
change. K is A for shifted bodies, and A - S for steady rolling; `conjugate`, `iteration` and
`newton` compute the steps. Progress means a smaller residual.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Displacements, Products
from toeplitz_mg.contact.tangential.law import Areas, Problem, State, along, scale_to_bound, size
from toeplitz_mg.contact.tangential.loads import (
    Loads,
    Look,
    carry,
    find_displacements,
    look,
)

EXACT = 0.1  # Allowed final error of displacements, as a share of the tolerance.
HOPE = 5  # Steps without progress, after which steps are damped.
UNCARRIED = 1e-3  # If a larger share of the loads is missing, tractions are changed to carry them.
TIGHTER = 0.1  # Factor for the misfit that a step leaves, after one without progress.
LEAST_ETA = 1e-4  # Smallest misfit that a step leaves, relative to the error of the sets.
DAMPED = 0.5  # Factor of damped steps.
BETTER = 0.9  # A residual is progress if below this multiple of the smallest so far.


class Step(Protocol):
    """Computes a step of Newton's method for fixed areas."""

    def __call__(
        self, now: Look, areas: Areas, q: Array, u: Array, eta: float
    ) -> tuple[Array, Array | None, int]:
        """Return a change of the tractions, its displacements if known, and the iterations.

        The misfit that it leaves may be `eta` times the error of the areas.
        """


def settle(
    problem: Problem,
    loads: Loads,
    K: Products,
    guess: tuple[Array, Areas],
    step: Step,
    patience: int,
    dtype: DTypeLike = np.float64,
) -> State:
    """Change tractions and areas until they satisfy Coulomb's law, or stop improving.

    Parameters
    ----------
    problem, loads
        `loads` are the loads that are given instead of a shift or creepages.
    K : Products
        Products with A, or with A - S.
    guess : (ndarray, Areas)
        Initial admissible tractions and areas.
    step, patience
        Computes a step; the number of changes of the areas without a smaller residual after which
        the search is given up.
    dtype : float32 or float64
        The precision of products with changes of the tractions.
    """
    g, (q, areas) = problem.g, guess
    q = carry(problem, loads, areas, q)
    displacements = Displacements(K, q, dtype)
    best, left, problem_now = None, patience, problem
    iterations: tuple[int, ...] = ()
    while True:
        now = look(problem, loads, areas, q, displacements.u)
        allowed = EXACT * problem.tolerance * now.law.scale
        if now.residual <= problem.tolerance and displacements.lost > allowed and not K.exhausted:
            displacements.renew()
            continue
        left = patience if best is None or now.residual < BETTER * best.residual else left - 1
        state = State(q, displacements.u, areas, now.creepages, now.residual, iterations)
        if best is None or state.residual < best.residual:
            best = state
        if K.exhausted:  # This is the last search.
            return replace(best, iterations=iterations)
        if now.residual <= problem.tolerance or left == 0:
            return state
        K.progress, K.residual = problem.progress, now.residual
        change = now.residual * now.law.scale
        eta = max(TIGHTER ** (patience - left), LEAST_ETA)
        v, Kv, count = step(now, areas, q, displacements.u, eta)
        iterations = (*iterations, count)
        if left <= patience - HOPE:
            # Full steps may cycle, if elements turn out wrong in either area.
            v, Kv = DAMPED * v, Kv if Kv is None else DAMPED * Kv
        bound, before, q = g, q, q + v
        out = areas.stick & (size(q) > g)
        if problem.falling is not None:
            q, bound = problem.falling.change(now, areas, before, v, g)
            problem_now = replace(problem, g=bound)
        q = scale_to_bound(q, bound, areas.slide | out)
        stuck = areas.exchange(out, np.zeros_like(out))
        q = carry(problem_now, loads, stuck, q)
        if loads.error(q, problem.vectors) > UNCARRIED:
            q = loads.project(q, g, problem.vectors)
            areas, out = Areas.of(q, g), np.zeros_like(out)
            stuck = areas
        displacements.follow(q, change, allowed, None if Kv is None else (v, Kv))
        b = find_displacements(problem, loads, stuck, q, displacements.u)
        back = areas.slide & (along(b - displacements.u, now.law.T.n) < 0.0)
        areas = areas.exchange(out, back)
