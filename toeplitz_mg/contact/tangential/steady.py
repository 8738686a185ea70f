"""The steady state of rolling, directly: the areas of stick and slip for a matrix not symmetric.

The areas and Newton's method are those of `stick_slip`, with K = A - S in the place of A. As K is
not symmetric, GMRES takes the place of conjugate gradients, and there is no energy that each change
of the areas should lower (`active_sets`): progress is a smaller residual, and where there is none
for long, rolling step by step leads on.

GMRES is preconditioned by a shifted inverse of the symbol of K, â(θ)(1 - e^{iθ₁}). Its real part is
not negative, but it is zero for what is constant along the direction of rolling; with a positive
real shift it is nowhere small. Where elements slide, λ adds to K, so that the inverse is scaled
there by (1 + λ/k₀)^(-1/2) from both sides.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import Areas, along, clip, make_admissible, size
from toeplitz_mg.contact.tangential.stick_slip import (
    COARSE_PRODUCTS,
    SHARP,
    Linearisation,
    Problem,
    State,
    linearise,
    refine_guess,
    solve,
)
from toeplitz_mg.engine.krylov_space import KrylovSpace
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.operators import apply_to_rows

REDUCTION = 0.01  # Reduction of the residual by one solution where the problem is linearised.
SINGLE = 1e-5  # Reduction of the residual for which single precision is good.
LEAST_UNIT, MOST_UNIT = 1e-12, 1e12  # Least and largest diagonal of K in its range.
BETTER = 0.9  # Factor of the least residual so far, below which a new one is progress.
STEP_TOLERANCE = 1e-6  # Tolerance of a step of rolling that only leads to the steady state.


@dataclass(frozen=True)
class SteadyOptions:
    """How long the search for the steady state of rolling goes on.

    Attributes
    ----------
    iterations : int
        Most iterations of GMRES between two changes of the areas, all of whose vectors are kept.
    patience : int
        Changes of the areas without a smaller residual, after which it rolls step by step over the
        length of the grid, and searches on from there.
    """

    iterations: int = 60
    patience: int = 30


def find_steady_state(
    problem: Problem, K: Products, *, nested: bool, options: SteadyOptions
) -> State:
    """Find the tractions and the areas of stick and slip of the steady state.

    Parameters
    ----------
    problem : Problem
        Its b is minus the rigid slip in a step of one element.
    K : Products
        Products with A - S.
    nested : bool
        Whether to start from the solution on coarser grids.
    options : SteadyOptions
    """
    g, b = problem.g, problem.b
    q, areas = _first_guess(problem, nested=nested, options=options)
    vectors = problem.vectors
    u = K(q) if vectors.count(q) else np.zeros_like(q)
    k0 = problem.grid.diagonal(K.A)
    dtype = np.float32 if LEAST_UNIT < k0 < MOST_UNIT else np.float64
    M, shift = None, 0.0
    best, patience = np.inf, options.patience
    iterations: list[int] = []
    while True:
        law = linearise(problem, areas, q, u)
        if law.residual <= problem.tolerance or K.exhausted:
            return State(q, u, areas, law.shift, law.residual, tuple(iterations))
        K.progress, K.residual = problem.progress, law.residual
        if shift != (shift := _shift(areas, vectors)) or M is None:
            M = problem.grid.invert_shifted(K.A, shift, dtype)
        v, count = _newton_step(problem, law, areas, q, K, M, options)
        iterations.append(count)
        q = q + v
        out = areas.stick & (size(q) > g)
        on_circle = areas.slide | out
        q, _ = make_admissible(q, g, areas, on_circle, None, vectors)
        u = K(q)
        back = areas.slide & (along(b - u, law.T.n) < 0.0)
        areas = areas.exchange(out, back)
        patience = options.patience if law.residual < BETTER * best else patience - 1
        best = min(best, law.residual)
        if patience == 0:
            q, areas = _roll_on(problem, q, K)
            u, best, patience = K(q), np.inf, options.patience


def _newton_step(
    problem: Problem,
    law: Linearisation,
    areas: Areas,
    q: Array,
    K: Products,
    M: LinearOperator,
    options: SteadyOptions,
) -> tuple[Array, int]:
    """Return a change of the tractions, and the iterations."""
    T, lam, r, vectors = law.T, law.stiffness, law.r, problem.vectors
    k0 = problem.grid.diagonal(K.A)
    weight = np.where(areas.slide, 1.0 / np.sqrt(1.0 + lam / k0), 1.0)
    before = vectors.norm(r)
    if before == 0.0:
        return np.zeros_like(r), 0
    largest = vectors.max(np.abs(r))
    exact = max(SHARP * problem.tolerance * law.scale, SINGLE * before)
    if len(r) > 1 and vectors.count(areas.slide):  # The circle |q| = g is linearised.
        exact = max(exact, REDUCTION * before)

    def goal(v: Array) -> float:
        return max(exact, k0 * problem.excess(q + v) * before / largest)

    most = min(options.iterations, max(1, K.limit - K.count))
    # All of them are kept, so that the goal of each iterate is told without a product more.
    directions = np.empty((most, *r.shape), M.dtype)

    def multiply(v: Array, out: Array) -> Array:
        d = directions[space.dimension]
        d[...] = T(weight * apply_to_rows(M, (weight * T(v)).reshape(-1)).reshape(v.shape))
        return T(K(d)) + lam * d

    space = KrylovSpace(multiply, r.shape, M.dtype, most, vectors)
    space.begin(r)
    while True:
        least = space.extend()
        v = vectors.combine(space.weights(), directions[: space.dimension]).astype(np.float64)
        if least <= goal(v) or space.dimension == most:
            return v, space.dimension


def _shift(areas: Areas, vectors: Vectors) -> float:
    """Return the shift of the symbol, from 0.04 where all sticks to 0.32 where all slides.

    Both ends, and what is between, were found by experiment. It is rounded to a power of two times
    0.04, so that the inverse is set up a few times only.
    """
    sliding = vectors.count(areas.slide) / max(1, vectors.count(areas.slide | areas.stick))
    return float(0.04 * 2.0 ** np.round(np.log2(1.0 + 7.5 * sliding**3)))


def _first_guess(problem: Problem, *, nested: bool, options: SteadyOptions) -> tuple[Array, Areas]:
    coarse = problem.coarser() if nested else None
    if coarse is None:
        return np.zeros(problem.b.shape), Areas(problem.g > 0.0, np.zeros(problem.g.shape, bool))
    # The rigid slip in a step is in proportion to the step.
    grid = coarse.grid
    coarse = replace(coarse, b=coarse.b * (grid.element[0] / problem.grid.element[0]))
    K = Products(grid.steady(grid.tangential()), COARSE_PRODUCTS)
    return refine_guess(problem, find_steady_state(coarse, K, nested=True, options=options))


def _roll_on(problem: Problem, q: Array, K: Products) -> tuple[Array, Areas]:
    """Roll over the length of the grid step by step (Eq. 8): slow, but towards the steady state."""
    A, S = problem.grid.tangential(), problem.grid.upstream()
    for _ in range(problem.grid.shape[0]):
        b = problem.b + apply_to_rows(S, q.reshape(-1)).reshape(q.shape)
        products = Products(A, K.limit - K.count)
        tolerance = max(problem.tolerance, STEP_TOLERANCE)
        step = replace(problem, b=b, tolerance=tolerance, progress=K.tell_more)
        q = solve(step, products, clip(q, problem.g), nested=False).q
        K.count += products.count + 1
        if K.exhausted:
            break
    return q, Areas.of(q, problem.g)
