"""The search for the areas of stick and slip, for bodies that are shifted or roll.

Both use `settling`. On few elements a step of it is a Newton step with the matrix as an array
(`newton`). On more, for *shifted* bodies, whose matrix A is symmetric, it uses conjugate gradients
(`conjugate`). If the areas cycle, projected gradients decrease the convex energy ½ q·Aq - b·q.

For bodies that *roll* steadily, K = A - S is not symmetric, so approximate inverses with
acceleration are used (`iteration`). On small grids the search starts from the leading edge, on
large ones from the solution on elements of twice the size. If the areas do not settle, it continues
by rolling step by step; for given loads it searches for the creepages (`by_loads`).

The approximate inverses use the symbol of K, â(θ)(1 - e^{iθ₁}), plus ν, for a few values of ν.
Where elements stick, K is to be inverted; where they slide, K + λ with varying λ, for which the
inverses are interpolated. The inverse of K is also accurate at the edges of the stick area
(`preconditioners.causal`); on fragmented areas it is composed of those of runs
(`preconditioners.runs`). So the number of products does not depend on that of the elements. (With a
single ν it doubled from 128² to 512² elements; without the edges it grew by up to 1.5.)
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import precision_for
from toeplitz_mg.contact.grid import COARSEST
from toeplitz_mg.contact.inverse import extend_to_components, invert_steady
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected_gradients import descend
from toeplitz_mg.contact.tangential.by_loads import roll_by_creepages, search_creepages
from toeplitz_mg.contact.tangential.conjugate import ConjugateSteps
from toeplitz_mg.contact.tangential.iteration import Iteration
from toeplitz_mg.contact.tangential.law import (
    Areas,
    Problem,
    State,
    admit,
    clip,
    largest_bound,
    size,
)
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.contact.tangential.newton import find_directly
from toeplitz_mg.contact.tangential.settling import settle
from toeplitz_mg.contact.tangential.starts import guess_sliding
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import count

COARSE_PRODUCTS = 200  # Limit of products on a coarser grid, which only gives an initial guess.
PATIENCE = 12  # Changes of the areas without progress, after which projected gradients are used.
RESCUE = 40  # Steps of projected gradients: enough to leave a cycle of areas.
# Ratio of the gap between traction and bound on one side of an edge to slip/k₀ on the other: 0.5
# leaves about the fewest elements in the wrong area; 0.25 and 1.0 leave up to twice as many.
EDGE = 0.5
# Tolerance for the loads in the search for creepages, and the factor by which the next search is
# tighter if that was not enough.
LOOSE, CLOSER = 1e-2, 1e-2
MORE = 20  # Number of iterations combined if fewer were not enough.
STEP_TOLERANCE = 1e-6  # Tolerance of a step of rolling on the way to the steady state.


@dataclass(frozen=True)
class SteadyOptions:
    """Limits of the direct search for the steady state of rolling.

    Attributes
    ----------
    iterations : int
        Number of previous iterations whose products are kept and combined with the next one. More
        than 3 save little.
    patience : int
        Iterations without a smaller residual, after which 20 are combined. If that fails too, the
        bodies roll step by step over the length of the grid, or other creepages are tried if loads
        are given, and the search starts again.

    Raises
    ------
    ValueError, TypeError
        If a value is not an integer or below 1.

    See Also
    --------
    rolling : takes it as ``options=``.
    """

    iterations: int = 5
    patience: int = 30

    def __post_init__(self) -> None:
        for name in ("iterations", "patience"):
            count(name, getattr(self, name))


def solve_shifted(
    problem: Problem,
    loads: Loads,
    A: Products,
    guess: tuple[Array, Areas] | None = None,
    *,
    nested: bool,
) -> State:
    """Find the tractions and the areas of stick and slip for bodies that are shifted.

    The search starts from a guess (admissible tractions and their areas) or, if `nested`, from the
    solution on coarser grids. The shift of the returned state belongs to the loads.
    """
    grid, C = problem.grid, problem.g > 0.0
    if not grid.vectors.count(C):
        nothing, nowhere = np.zeros_like(problem.b), np.zeros_like(C)
        areas = Areas(nowhere, nowhere)
        return State(nothing, nothing, areas, np.zeros(len(loads.wanted)), residual=0.0)
    array = grid.dense(C, steady=False)
    if guess is None:
        guess = _guess_shifted(problem, loads, nested=nested and array is None)
    iterations: tuple[int, ...] = ()
    if array is not None:
        state = find_directly(problem, loads, A, array, guess, PATIENCE)
        if state.residual <= problem.tolerance or A.exhausted:
            return state
        guess, iterations = (state.q, state.areas), state.iterations
    q, areas = np.ascontiguousarray(guess[0][:, C]), Areas(guess[1].stick[C], guess[1].slide[C])
    few, some, vectors = problem.restrict(C), loads.restrict(C), problem.vectors
    products = Products(grid.restrict(A.A, extend_to_components(grid, A.A, C)), A.limit)
    products.count = A.count
    step = ConjugateSteps(few, some, products, (grid, A.A, C))
    dtype = precision_for(grid.diagonal(A.A))
    project = partial(some.project, g=few.g, vectors=vectors)
    while True:
        state = settle(few, some, products, (q, areas), step, PATIENCE, dtype)
        iterations += state.iterations
        if state.residual <= problem.tolerance or products.exhausted:
            break
        L, start = products.A.norm_bound, project(state.q)
        q, _ = descend(products, few.b, start, project, L, RESCUE, vectors)
        areas = Areas.of(q, few.g)
    A.count = products.count
    return replace(state, iterations=iterations).extend(C)


def _guess_shifted(problem: Problem, loads: Loads, *, nested: bool) -> tuple[Array, Areas]:
    """Return admissible tractions and areas as initial guess."""
    coarse, grid = problem.coarser() if nested else None, problem.grid
    if coarse is None:
        q = loads.spread(problem.g, problem.vectors) + np.zeros(problem.b.shape)
        return admit(problem, q, np.zeros(problem.g.shape, bool))
    A = Products(coarse.grid.tangential(), COARSE_PRODUCTS)
    state = solve_shifted(coarse, loads.coarser(grid, coarse), A, nested=True)
    slide = grid.refine(state.areas.slide.astype(np.float64)) > 0.5
    return admit(problem, grid.refine(state.q), slide)


def find_steady_state(
    problem: Problem,
    loads: Loads,
    guess: tuple[Array, Areas] | None = None,
    *,
    K: Products,
    nested: bool,
    options: SteadyOptions,
) -> State:
    """Find the tractions and the areas of stick and slip in the steady state of rolling.

    The vector b is minus the given part of the rigid slip in a step of one element; products are
    with K = A - S. The search starts from a guess (admissible tractions and their areas) or, if
    `nested`, from the solution on coarser grids. The shift of the returned state holds the unknown
    creepages.
    """
    grid, patience = problem.grid, options.patience
    iterations: tuple[int, ...] = ()
    best: State | None = None
    array = grid.dense(problem.g > 0.0, steady=True)
    # A problem too large for the direct solver is coarsened until it is small enough.
    coarsest = 1 if array is None else COARSEST
    from_coarser = partial(_guess_from_coarser_grids, problem, loads, options, coarsest)
    may_refine = guess is None and nested
    refines = may_refine and grid.coarser(coarsest) is not None
    if guess is None and len(loads.wanted) and problem.falling is None:
        is_line = len(grid.shape) == 1
        guess = guess_sliding(problem, loads, K, only_start=not (refines and is_line))
    if guess is None and refines:
        guess, may_refine = from_coarser(), False
    if array is not None:
        state = find_directly(problem, loads, K, array, guess, patience)
        if state.residual <= problem.tolerance or K.exhausted:
            return replace(state, iterations=(sum(state.iterations),))
        best, guess, iterations = state, (state.q, state.areas), (sum(state.iterations),)
    M = invert_steady(grid, K.A, problem.g > 0.0, precision_for(grid.diagonal(K.A)))
    if guess is None:
        guess = admit(problem, np.zeros(problem.b.shape), np.zeros(problem.g.shape, bool))
    accuracy, creepages, depth = LOOSE, np.zeros(len(loads.wanted)), options.iterations
    while True:
        step = Iteration(problem, loads, M, depth)
        state = settle(problem, loads, K, guess, step, patience, M.dtype)
        iterations += (sum(state.iterations),)
        best = state if best is None or state.residual < best.residual else best
        if state.residual <= problem.tolerance or K.exhausted:
            return replace(best, iterations=iterations)
        if may_refine and (refined := from_coarser()):
            guess, may_refine = refined, False
        elif depth < MORE:
            depth, guess = MORE, (state.q, state.areas)
        elif problem.falling is not None:
            return replace(best, iterations=iterations)
        elif len(loads.wanted) and problem.vectors.max(problem.g) < np.inf:
            find = partial(find_steady_state, K=K, nested=False, options=options)
            roll = partial(roll_by_creepages, find, problem, loads)
            state, creepages = search_creepages(problem, loads, K, roll, state, creepages, accuracy)
            residual = max(state.residual, loads.error(state.q, problem.vectors))
            if residual <= problem.tolerance:
                return replace(state, shift=creepages, residual=residual, iterations=iterations)
            guess, accuracy = (state.q, state.areas), CLOSER * accuracy
        else:
            b = problem.b + problem.vectors.combine(state.shift, loads.units)
            guess = _roll_on(replace(problem, b=b), state.q, K)


def _guess_from_coarser_grids(
    problem: Problem, loads: Loads, options: SteadyOptions, coarsest: int
) -> tuple[Array, Areas] | None:
    """Return tractions and areas as initial guess, or None if there is no coarser grid."""
    coarse = problem.coarser(coarsest)
    if coarse is None:
        return None
    # The rigid slip in a step is proportional to the step.
    fine, grid = problem.grid, coarse.grid
    longer = grid.element[0] / fine.element[0]
    coarse, loads = replace(coarse, b=coarse.b * longer), loads.coarser(fine, coarse, longer)
    K = Products(grid.steady(grid.tangential()), COARSE_PRODUCTS)
    if problem.falling is not None:
        law = replace(problem.falling, h=grid.element[0], k0=grid.diagonal(K.A))
        coarse = replace(coarse, falling=law.within(fine.refine, fine.coarsen))
    state = find_steady_state(coarse, loads, K=K, nested=True, options=options)
    if len(loads.wanted):
        coarse = replace(coarse, b=coarse.b + grid.vectors.combine(state.shift, loads.units))
    beyond = _measure_distance(coarse, state, grid.diagonal(K.A))
    return admit(problem, fine.refine(state.q), fine.refine(beyond) < 0.0)


def _measure_distance(problem: Problem, state: State, k0: float) -> Array:
    """Return a field that is linear across the edge between stick and slip, negative in slip.

    With the distance from the edge, both the traction's distance from the bound, on one side, and
    the slip, on the other, grow like a square root; the field consists of their squares.
    """
    g, vectors = problem.g, problem.vectors
    largest = largest_bound(g, vectors) or 1.0
    lacking = np.minimum((g - size(state.q)) / largest, 1.0)
    slip = np.minimum(EDGE * size(problem.b - state.u) / (k0 * largest), 1.0)
    distance: Array = np.where(state.areas.slide, -(slip**2), lacking**2)
    return np.where(g > 0.0, distance, 0.0)


def _roll_on(problem: Problem, q: Array, K: Products) -> tuple[Array, Areas]:
    """Roll over the length of the grid step by step (Eq. 8), towards the steady state."""
    A, S = problem.grid.tangential(), problem.grid.upstream()
    for _ in range(problem.grid.shape[0]):
        b = problem.b + apply_to_rows(S, q.reshape(-1)).reshape(q.shape)
        products = Products(A, K.limit - K.count)
        tolerance = max(problem.tolerance, STEP_TOLERANCE)
        step = replace(problem, b=b, tolerance=tolerance, progress=K.tell_more)
        guess = admit(step, clip(q, step.g), np.zeros(step.g.shape, bool))
        q = solve_shifted(step, Loads.of_sums(None, q), products, guess, nested=False).q
        K.count += products.count + 1
        if K.exhausted:
            break
    return q, Areas.of(q, problem.g)
