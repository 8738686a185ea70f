"""The steady state of rolling, directly: the areas of stick and slip for a matrix not symmetric.

Of few elements the matrix is an array (`newton`); of many, approximate inverses and acceleration do
(`iteration`). Of few the search starts from the leading edge, of many from the solution on elements
of twice the size. Where the areas do not settle, rolling step by step leads on, and where loads are
given a search for their creepages (`by_loads`).

The approximate inverses are of the symbol of K, â(θ)(1 - e^{iθ₁}), plus ν, for a few ν. Where
elements stick it is K that is to be inverted, and where they slide K + λ, with λ of any size: in
each place the inverses are interpolated to its λ. That of K itself is right at the edges of where
it sticks, too (see `preconditioners.causal`), and on fragmented areas made of their runs (see
`preconditioners.runs`). So the products do not depend on the number of elements. (With one ν for
all, they doubled from 128² elements to 512²; without the edges, they grew by up to 1.5.)

Where loads are given, a change of the tractions takes up what is missing of them; the rest of it is
orthogonal to the fields whose inner products with tractions the loads are, and the slip that it
removes to the rigid slip by unknown creepages, which follow from that. So a case by force takes
about as many products as one by creepage.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.dense import LEAST_UNIT, MOST_UNIT
from toeplitz_mg.contact.grid import COARSEST
from toeplitz_mg.contact.inverse import invert_steady
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.by_loads import roll_by_creepages, search_creepages
from toeplitz_mg.contact.tangential.coulomb import Areas, clip, size
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.iteration import Iteration
from toeplitz_mg.contact.tangential.near_sliding import guess_sliding
from toeplitz_mg.contact.tangential.newton import find_directly
from toeplitz_mg.contact.tangential.problem import Problem, State, admit, largest_bound
from toeplitz_mg.contact.tangential.settling import settle
from toeplitz_mg.contact.tangential.shifted import COARSE_PRODUCTS, coarsen_each, solve
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import count

# Ratio of what tractions lack of the bound on one side of an edge to slip/k₀ on the other: 0.5
# leaves about the fewest elements in the wrong area; 0.25 and 1.0 leave up to twice as many.
EDGE = 0.5
# Part of the load of sliding bodies to which creepages are searched for, and by how much the next
# search is closer, where that has not been enough.
LOOSE, CLOSER = 1e-2, 1e-2
MORE = 20  # Iterations that are combined where fewer have not been enough.
STEP_TOLERANCE = 1e-6  # Tolerance of a step of rolling that only leads to the steady state.


@dataclass(frozen=True)
class SteadyOptions:
    """How long the search for the steady state of rolling goes on.

    Attributes
    ----------
    iterations : int
        Most iterations whose products are kept, and combined with the next one. Beyond 3 they save
        little.
    patience : int
        Iterations without a smaller residual, after which 20 are combined; and the next time it
        rolls step by step over the length of the grid, or by other creepages where loads are given,
        and searches on from there.

    Raises
    ------
    ValueError, TypeError
        For what is no integer, or below 1.

    See Also
    --------
    rolling : takes it as ``options=``.
    """

    iterations: int = 5
    patience: int = 30

    def __post_init__(self) -> None:
        for name in ("iterations", "patience"):
            count(name, getattr(self, name))


def find_steady_state(
    problem: Problem,
    loads: Loads,
    guess: tuple[Array, Areas] | None = None,
    *,
    K: Products,
    nested: bool,
    options: SteadyOptions,
) -> State:
    """Find the tractions and the areas of stick and slip of the steady state.

    Parameters
    ----------
    problem : Problem
        Its b is minus the rigid slip in a step of one element, by what is given of it.
    loads : Loads
        The loads that are given in the place of creepages.
    guess : (ndarray, Areas), optional
        Admissible tractions and areas to start from.
    K : Products
        Products with A - S.
    nested : bool
        Whether to start from the solution on coarser grids, where there is no guess.
    options : SteadyOptions

    Returns
    -------
    State
        Its shift is the unknown creepages.
    """
    patience = options.patience
    iterations: tuple[int, ...] = ()
    best: State | None = None
    array = problem.grid.dense(problem.g > 0.0, steady=True)
    grid = problem.grid
    # What is not solved directly has at least that for a coarser grid which is.
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
    k0 = grid.diagonal(K.A)
    dtype = np.float32 if LEAST_UNIT < k0 < MOST_UNIT else np.float64
    M = invert_steady(grid, K.A, problem.g > 0.0, dtype)
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
    """Return tractions and areas to start from, or None where no grid is coarser."""
    coarse = problem.coarser(coarsest)
    if coarse is None:
        return None
    # The rigid slip in a step is in proportion to the step.
    fine, grid = problem.grid, coarse.grid
    longer = grid.element[0] / fine.element[0]
    coarse = replace(coarse, b=coarse.b * longer)
    units, arms = (coarsen_each(fine, fields, coarse.b) for fields in (loads.units, loads.arms))
    loads = Loads(longer * units, grid.area / fine.area * arms, loads.wanted)
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

    What the tractions lack of the bound grows with the root of the distance from that edge, as on
    the other side the slip does: here are their squares.
    """
    g, vectors = problem.g, problem.vectors
    largest = largest_bound(g, vectors) or 1.0
    lacking = np.minimum((g - size(state.q)) / largest, 1.0)
    slip = np.minimum(EDGE * size(problem.b - state.u) / (k0 * largest), 1.0)
    distance: Array = np.where(state.areas.slide, -(slip**2), lacking**2)
    return np.where(g > 0.0, distance, 0.0)


def _roll_on(problem: Problem, q: Array, K: Products) -> tuple[Array, Areas]:
    """Roll over the length of the grid step by step (Eq. 8): slow, but towards the steady state."""
    A, S = problem.grid.tangential(), problem.grid.upstream()
    for _ in range(problem.grid.shape[0]):
        b = problem.b + apply_to_rows(S, q.reshape(-1)).reshape(q.shape)
        products = Products(A, K.limit - K.count)
        tolerance = max(problem.tolerance, STEP_TOLERANCE)
        step = replace(problem, b=b, tolerance=tolerance, progress=K.tell_more)
        guess = admit(step, clip(q, step.g), np.zeros(step.g.shape, bool))
        q = solve(step, Loads.of_sums(None, q), products, guess, nested=False).q
        K.count += products.count + 1
        if K.exhausted:
            break
    return q, Areas.of(q, problem.g)
