"""Pressures, from a first guess: that of coarser grids, or one from other loads."""

from math import prod
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.active_sets import Iterate, find_sets
from toeplitz_mg.contact.normal.active_set import Search
from toeplitz_mg.contact.normal.exchange import press_all_but_few
from toeplitz_mg.contact.products import Products, for_coarser_grids

ETA = 0.5  # Misfit that is left on a set, relative to its violation, while the energy falls.
EXACT_ETA = 0.1  # The same where each set has an FSAI of its own, and few iterations.
ROUGH = 0.2  # Tolerance on a coarser grid, relative to the detail of the gap that it does not have.
# Limits of the tolerance on a coarser grid: a finer guess, and a rougher, save nothing.
LEAST, MOST = 1.5e-3, 1e-2
FALL = 0.5  # Part of the error that a step may leave: beyond, the search changes the set.
DAMPING = 0.5  # Part of Jacobi's step by which the pressures follow the detail of a finer grid.
FULL = 1e-13  # Part of the largest force, which all elements carry at the hardness, as rounding.
COARSE_PRODUCTS = 200  # Most products on a coarser grid, whose answer is but a guess.


class State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float = 0.0
    iterations: tuple[int, ...] = ()


def solve(search: Search, A: Products, *, nested: bool, guess: Array | None = None) -> State:
    """Find the pressures and the area of contact.

    Parameters
    ----------
    search : Search
    A : Products
        With its matrix.
    nested : bool
        Whether the first guess comes from coarser grids, where there is no other.
    guess : ndarray, optional
        Pressures, none of which is negative, that are near those to be found.
    """
    before: tuple[int, ...] = ()
    if guess is None:
        guess, before = press_all_but_few(search, A, _eta(search))
    if guess is None:
        state = _search_from(search, A, *_first_guess(search, nested=nested))
    else:
        near = _come_near(search, A, guess)
        state = _search_from(search, A, near.x, near.sets, near.u)
    return state._replace(iterations=before + state.iterations)


def _search_from(search: Search, A: Products, p: Array, C: Array, u: Array | None = None) -> State:
    """Find the pressures from some, of which the displacements may be known, and from a set."""
    now, law, iterations = find_sets(
        search,
        A,
        p,
        C,
        u=u,
        b=(search.approach or 0.0) - search.z,
        eta=_eta(search),
        tolerance=search.tolerance,
        progress=search.progress,
    )
    return State(now.x, now.u, law.touching, law.residual, iterations)


def _eta(search: Search) -> float:
    """Return the misfit that is left on the first sets."""
    return EXACT_ETA if search.inverse.is_slow else ETA


def _come_near(search: Search, A: Products, p: Array) -> Iterate:
    """Return what some steps make of pressures that are nearly right: their set, above all.

    A step corrects the pressures by the approximate inverse, and clips those below zero. On a
    set that is nearly right that leaves less than a fifth of the error, and takes one product,
    where an iteration on the set and a change of it take two.
    """
    p = search.clip(p)
    now, before = Iterate(p, A(p), search.sets_of(p)), None
    error = search.look(now).residual
    A.progress = search.progress
    while error > search.tolerance and not A.exhausted:
        A.residual = error
        following = _step(search, A, now, before)
        fallen = search.look(following).residual
        if fallen > FALL * error:
            return following if fallen < error else now
        now, before, error = following, now, fallen
    return now


def _step(search: Search, A: Products, now: Iterate, before: Iterate | None) -> Iterate:
    """Correct pressures by the approximate inverse, where they will be free (`Search.change`).

    As in conjugate gradients the step before is given the length at which the error is least, and
    the direction is conjugate to it. Only the length of the last step is as yet unknown: it is one.
    """
    gap, M, vectors = search.look(now).look.gap, search.inverse, A.vectors
    xp = vectors.xp
    C = search.change(now.x, gap)
    if not vectors.count(C):
        return now
    r = xp.where(C, -gap, 0.0)
    curvature = lack = 0.0
    if before is not None:
        last, product = (
            xp.where(C, after - earlier, 0.0)
            for after, earlier in ((now.x, before.x), (now.u, before.u))
        )
        curvature = vectors.dot(last, product)
    if curvature > 0.0:
        lack = vectors.dot(r, last) / curvature
        r = r - lack * product
    largest = vectors.max(xp.abs(r)) or 1.0
    M.fit(C, is_near=True)
    change = xp.where(C, M(vectors.cast(r / largest, M.dtype)), 0.0) * largest
    change = vectors.cast(change, np.float64)
    if search.force is not None:
        change = xp.where(C, change - vectors.sum(change) / vectors.count(C), 0.0)
    if curvature > 0.0:
        change = change + (lack - vectors.dot(change, product) / curvature) * last
    p = search.clip(now.x + change)
    return Iterate(p, A(p), search.sets_of(p))


def _first_guess(search: Search, *, nested: bool) -> tuple[Array, Array]:
    """Return pressures and elements in contact: of a coarser grid, or more than in contact."""
    zeros, z = search.grid.vectors.zeros, search.z
    if search.force is not None:
        everywhere = search.total / prod(search.grid.shape)
        if everywhere >= search.most * (1.0 - FULL):
            return zeros(z) + search.most, zeros(z, bool)
    coarse = _coarser(search) if nested else None
    if coarse is not None:
        products = Products(coarse.matrix, COARSE_PRODUCTS)
        state = _search_from(coarse, products, *_first_guess(coarse, nested=True))
        search.inverse.is_slow = coarse.inverse.is_slow
        p = _interpolate(search, state, search.unit / coarse.unit)
        if search.grid.vectors.count(p):
            return p, search.sets_of(p)
    if search.approach is not None:
        return zeros(z), z < search.approach
    return zeros(z) + everywhere, ~zeros(z, bool)


def _coarser(search: Search) -> Search | None:
    """Return the problem on a coarser grid, or None where that says nothing."""
    grid = search.grid.coarser()
    if grid is None:
        return None
    z, vectors = search.grid.coarsen(search.z), search.grid.vectors
    if search.approach is not None and not grid.vectors.count(z < search.approach):
        return None  # The averages touch nowhere.
    detail = vectors.max(vectors.xp.abs(search.z - search.grid.refine(z)))
    detail /= vectors.max(search.z) - search.lowest or 1.0
    tolerance = min(max(LEAST, ROUGH * detail), MOST)
    progress = for_coarser_grids(search.progress)
    return Search(grid, z, search.approach, search.force, tolerance, progress, search.hardness)


def _interpolate(search: Search, coarse: State, ratio: float) -> Array:
    """Interpolate from a coarser grid, and follow the detail that it does not have.

    That is a step of Jacobi's iteration, without a product, as displacements are smooth.
    """
    p, u = (search.grid.refine(x) for x in (coarse.p, coarse.u))
    vectors = search.grid.vectors
    p = ratio * p - DAMPING * (u + search.z - coarse.approach)
    p = vectors.xp.clip(p, 0.0, search.most)
    return search.clip(p) if vectors.count(p) else p
