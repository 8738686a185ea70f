"""Bodies that are shifted: their areas of stick and slip, from coarser grids or from a guess."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import LEAST_UNIT, MOST_UNIT
from toeplitz_mg.contact.inverse import extend_to_components
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected_gradients import descend
from toeplitz_mg.contact.tangential.conjugate import ConjugateSteps
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.newton import find_directly
from toeplitz_mg.contact.tangential.problem import Problem, State, admit
from toeplitz_mg.contact.tangential.settling import settle

COARSE_PRODUCTS = 200  # Most products on a coarser grid, whose answer is but a guess.
PATIENCE = 12  # Changes of the areas without progress, after which projected gradients descend.
RESCUE = 40  # Steps of projected gradients: enough to leave areas that come back.


def solve(
    problem: Problem,
    loads: Loads,
    A: Products,
    guess: tuple[Array, Areas] | None = None,
    *,
    nested: bool,
) -> State:
    """Find the tractions and the areas of stick and slip of bodies that are shifted.

    Parameters
    ----------
    problem : Problem
    loads : Loads
        The loads that are given in the place of a shift.
    A : Products
    guess : (ndarray, Areas), optional
        Admissible tractions to start from, that are not too far off, and their areas.
    nested : bool
        Whether to start from the solution on coarser grids, where there is no guess.

    Returns
    -------
    State
        Its shift is that which belongs to the loads.
    """
    grid, C = problem.grid, problem.g > 0.0
    if not grid.vectors.count(C):
        nothing, nowhere = np.zeros_like(problem.b), np.zeros_like(C)
        areas = Areas(nowhere, nowhere)
        return State(nothing, nothing, areas, np.zeros(len(loads.wanted)), residual=0.0)
    matrix = grid.dense(C, steady=False)
    if guess is None:
        guess = _first_guess(problem, loads, nested=nested and matrix is None)
    iterations: tuple[int, ...] = ()
    if matrix is not None:
        state = find_directly(problem, loads, A, matrix, guess, PATIENCE)
        iterations = state.iterations
        if state.residual <= problem.tolerance or A.exhausted:
            return state
        guess = state.q, state.areas
    q, areas = np.ascontiguousarray(guess[0][:, C]), Areas(guess[1].stick[C], guess[1].slide[C])
    few, some = problem.restrict(C), loads.restrict(C)
    restricted = Products(grid.restrict(A.A, extend_to_components(grid, A.A, C)), A.limit)
    restricted.count = A.count
    steps = ConjugateSteps(few, some, restricted, (grid, A.A, C))
    is_single = LEAST_UNIT < grid.diagonal(A.A) < MOST_UNIT
    while True:
        dtype = np.float32 if is_single else np.float64
        state = settle(few, some, restricted, (q, areas), steps, PATIENCE, dtype)
        iterations += state.iterations
        if state.residual <= problem.tolerance or restricted.exhausted:
            break

        # The energy ½ q·Aq - b·q is convex: gradients lead out of areas that come back.
        def project(q: Array) -> Array:
            return some.project(q, few.g, few.vectors)

        q, _ = descend(
            restricted,
            few.b,
            project(state.q),
            project,
            restricted.A.norm_bound,
            RESCUE,
            few.vectors,
        )
        areas = Areas.of(q, few.g)
    A.count = restricted.count
    return State(state.q, state.u, state.areas, state.shift, state.residual, iterations).extend(C)


def _first_guess(problem: Problem, loads: Loads, *, nested: bool) -> tuple[Array, Areas]:
    """Return admissible tractions to start from, and areas."""
    coarse = problem.coarser() if nested else None
    if coarse is None:
        q = loads.spread(problem.g, problem.vectors) + np.zeros(problem.b.shape)
        return admit(problem, q, np.zeros(problem.g.shape, bool))
    grid = problem.grid
    A = Products(coarse.grid.tangential(), COARSE_PRODUCTS)
    arms = coarsen_each(grid, loads.arms, coarse.b)
    units = coarsen_each(grid, loads.units, coarse.b)
    larger = coarse.grid.area / grid.area  # An element has more of the loads.
    state = solve(coarse, Loads(units, larger * arms, loads.wanted), A, nested=True)
    slide = grid.refine(state.areas.slide.astype(np.float64)) > 0.5
    return admit(problem, grid.refine(state.q), slide)


def coarsen_each(grid: Any, fields: Array, like: Array) -> Array:
    """Return the averages of fields on the coarser grid."""
    return np.array([grid.coarsen(f) for f in fields]).reshape(len(fields), *like.shape)
