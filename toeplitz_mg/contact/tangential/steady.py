"""The steady state of rolling, directly: the areas of stick and slip for a matrix not symmetric.

The sets and Newton's method are those of `stick_slip`, with K = A - S in the place of A. GMRES
takes the place of conjugate gradients, with a shifted inverse of the symbol of K: where elements
slide, λ adds to K, so that it is scaled there by (1 + λ/k₀)^(-1/2) from both sides.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import Products, dot
from toeplitz_mg.contact.tangential.coulomb import Areas, admissible, along, bounded, size
from toeplitz_mg.contact.tangential.shifted import shifted_inverse
from toeplitz_mg.contact.tangential.stick_slip import (
    COARSE_PRODUCTS,
    Linearised,
    Problem,
    State,
    diagonal,
    linearised,
    refined_guess,
    solve,
)
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator, apply_to_rows
from toeplitz_mg.solvers.gmres import gmres

REDUCTION = 0.01  # of the residual, by one solution with GMRES, where that is not exact
SINGLE = 1e-5  # of it, as single precision is good for no more,
RANGE = 1e-12, 1e12  # and for such units
MOST = 60  # iterations of one
PATIENCE = 30  # changes of the areas without any progress


def steady_operator(A: Any, S: Any) -> LinearOperator:
    """Return K = A - S, from the coefficients."""
    if not isinstance(A, CoupledOperator):
        return ToeplitzOperator.from_lags(A.lags - S.lags)
    return CoupledOperator(
        [
            [_difference(a, s) for a, s in pairs]
            for pairs in (zip(*rows, strict=True) for rows in zip(A.blocks, S.blocks, strict=True))
        ]
    )


def _difference(a: ToeplitzOperator | None, s: ToeplitzOperator | None) -> ToeplitzOperator | None:
    """Subtract blocks: on a single row of elements S couples the components, and A does not."""
    if s is None:
        return a
    return ToeplitzOperator.from_lags(-s.lags if a is None else a.lags - s.lags)


def steady(problem: Problem, K: Products, *, nested: bool) -> State:
    """Find the tractions and the areas of stick and slip of the steady state.

    Parameters
    ----------
    problem : Problem
        Its b is minus the rigid slip in a step of one element.
    K : Products
    nested : bool
        Whether to start from the solution on coarser grids.
    """
    g, b = problem.g, problem.b
    q, areas = _first_guess(problem, nested=nested)
    u = K(q) if q.any() else np.zeros_like(q)
    k0 = diagonal(K.A)
    dtype = np.float32 if RANGE[0] < k0 < RANGE[1] else np.float64
    M, shift = None, 0.0
    best, patience = np.inf, PATIENCE
    iterations: list[int] = []
    while True:
        law = linearised(problem, areas, q, u)
        if law.residual <= problem.tolerance or K.exhausted:
            return State(q, u, areas, law.shift, law.residual, tuple(iterations))
        if problem.progress is not None:
            problem.progress(K.count, law.residual)
        if shift != (shift := _shift(areas)) or M is None:
            M = shifted_inverse(K.A, shift).astype(dtype)
        v, count = _newton_step(problem, law, areas, q, K, M)
        iterations.append(count)
        q = q + v
        out = areas.stick & (size(q) > g)
        on_circle = areas.slide | out
        q, _ = admissible(q, g, areas, on_circle, None)
        u = K(q)
        back = areas.slide & (along(b - u, law.T.n) < 0.0)
        areas = areas.changed(out, back)
        patience = PATIENCE if law.residual < 0.9 * best else patience - 1
        best = min(best, law.residual)
        if patience == 0:
            q, areas = _roll_on(problem, q, K)
            u, best, patience = K(q), np.inf, PATIENCE


def _newton_step(
    problem: Problem, law: Linearised, areas: Areas, q: Array, K: Products, M: LinearOperator
) -> tuple[Array, int]:
    """Return a change of the tractions, and the iterations."""
    T, lam, r = law.T, law.stiffness, law.r
    contact, k0 = problem.g > 0.0, diagonal(K.A)
    weight = np.where(areas.slide, 1.0 / np.sqrt(1.0 + lam / k0), 1.0)
    norm = float(np.sqrt(dot(r, r)))
    if norm == 0.0:
        return np.zeros_like(r), 0
    exact = max(0.3 * problem.tolerance * law.scale, SINGLE * norm)
    if len(r) > 1 and areas.slide.any():  # the circle |q| = g is linearised
        exact = max(exact, REDUCTION * norm)

    def goal(v: Array) -> float:
        excess = float(np.max(size(q + v) - problem.g, where=contact, initial=0.0))
        return max(exact, k0 * excess * norm / float(np.abs(r).max()))

    return gmres(
        lambda v: T(K(v)) + lam * v,
        lambda v: T(weight * apply_to_rows(M, (weight * T(v)).reshape(-1)).reshape(v.shape)),
        r,
        goal,
        min(MOST, max(1, K.limit - K.count)),
        M.dtype,
    )


def _shift(areas: Areas) -> float:
    """The shift of the symbol: a power of two, from 0.04 where all sticks to 0.32 where all slides.

    Both ends were found by experiment, and what is between.
    """
    sliding = float(areas.slide.sum()) / max(1.0, float((areas.slide | areas.stick).sum()))
    return float(0.04 * 2.0 ** np.round(np.log2(1.0 + 7.5 * sliding**3)))


def _first_guess(problem: Problem, *, nested: bool) -> tuple[Array, Areas]:
    coarse = problem.coarser() if nested else None
    if coarse is None:
        return np.zeros(problem.b.shape), Areas(problem.g > 0.0, np.zeros(problem.g.shape, bool))
    # The rigid slip in a step is in proportion to the step.
    grid = coarse.grid
    coarse = replace(coarse, b=coarse.b * (grid.element[0] / problem.grid.element[0]))
    K = Products(steady_operator(grid.tangential(), grid.upstream()), COARSE_PRODUCTS)
    return refined_guess(problem, steady(coarse, K, nested=True))


def _roll_on(problem: Problem, q: Array, K: Products) -> tuple[Array, Areas]:
    """Roll over the length of the grid step by step (Eq. 8): slow, but towards the steady state."""
    A, S = problem.grid.tangential(), problem.grid.upstream()
    for _ in range(problem.g.shape[0]):
        b = problem.b + apply_to_rows(S, q.reshape(-1)).reshape(q.shape)
        products = Products(A, K.limit - K.count)
        step = replace(problem, b=b, tolerance=max(problem.tolerance, 1e-6), progress=None)
        q = solve(step, products, bounded(q, problem.g), nested=False).q
        K.count += products.count + 1
        if K.exhausted:
            break
    return q, Areas.of(q, problem.g)
