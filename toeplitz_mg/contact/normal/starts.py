"""Pressures, from a first guess: from other loads, from coarser grids, or nearly full contact.

A search starts from what is known, on the first of these ways that is open:

- Pressures under other loads are extrapolated. Near the edge of a contact they rise as the root of
  the distance from it, and the gap opens as its power 3/2. So p² where the bodies touch, and minus
  the power 2/3 of the gap elsewhere, are one field that is nearly linear in the distance, and in
  the load: it says where the edge will be. Pressures themselves know nothing of elements that do
  not touch yet.
- On a surface that repeats, and touches nearly everywhere, gap and pressure exchange their roles. A
  gap w after pressing takes the pressures p = P + K (w - z), where P is their mean, which the force
  gives, and K the inverse of A, but for the mean. So the conditions w ≥ 0, p ≥ 0, w p = 0 have the
  form of contact again: with the matrix K, the gap -K z before and the approach -P, w are the
  "pressures" and p is the "gap". What is "in contact" then are the few elements that are apart.
- The solution on a coarser grid is interpolated.
"""

from collections.abc import Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.normal.search import Iterate, Search, find_set
from toeplitz_mg.contact.products import Products, for_coarser_grids
from toeplitz_mg.engine.vectors import Vectors

ETA = 0.5  # Misfit that is left on a set, relative to its violation, while the energy falls.
EXACT_ETA = 0.1  # The same where each set has an FSAI of its own, and few iterations.
FALL = 0.5  # Part of the error that a step may leave: beyond, the search changes the set.
ROUGH = 0.2  # Tolerance on a coarser grid, relative to the detail of the gap that it does not have.
# Limits of the tolerance on a coarser grid: a finer guess, and a rougher, save nothing.
LEAST, MOST = 1.5e-3, 1e-2
DAMPING = 0.5  # Part of Jacobi's step by which the pressures follow the detail of a finer grid.
COARSE_PRODUCTS = 200  # Most products on a coarser grid, whose answer is but a guess.
AT_HARDNESS = 1e-13  # Part of the largest force, which all elements carry at it, as rounding.
# Pressure over the mean one that is usual near the edge of a contact: how fast the gap opens there.
EDGE = 0.5
PART = 0.5  # Part of the tolerance that is left to the exchange of gap and pressure.
# Force over its deviation in full contact beyond which few elements are pulled apart: a tenth of
# them where the pressures are normally distributed.
FULL = 1.28


class State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float = 0.0
    iterations: tuple[int, ...] = ()


def solve(search: Search, A: Products, *, nested: bool, guess: Array | None = None) -> State:
    """Find the pressures and the area of contact, from a guess or, `nested`, from coarser grids."""
    before: tuple[int, ...] = ()
    if guess is None:
        guess, before = _press_all_but_few(search, A)
    if guess is None:
        state = _search_from(search, A, *_first_guess(search, nested=nested))
    else:
        near = _come_near(search, A, guess)
        state = _search_from(search, A, near.p, near.C, near.u)
    return state._replace(iterations=before + state.iterations)


def _search_from(search: Search, A: Products, p: Array, C: Array, u: Array | None = None) -> State:
    """Find the pressures from some, of which the displacements may be known, and from a set."""
    now, law, iterations = find_set(search, A, p, C, u=u, eta=_eta(search))
    return State(now.p, now.u, law.touching, law.residual, iterations)


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
    now, before = Iterate(p, A(p), search.set_of(p)), None
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
    C = search.change(now.p, gap)
    if not vectors.count(C):
        return now
    r = xp.where(C, -gap, 0.0)
    curvature = lack = 0.0
    if before is not None:
        last, product = (
            xp.where(C, after - earlier, 0.0)
            for after, earlier in ((now.p, before.p), (now.u, before.u))
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
    p = search.clip(now.p + change)
    return Iterate(p, A(p), search.set_of(p))


def _first_guess(search: Search, *, nested: bool) -> tuple[Array, Array]:
    """Return pressures and elements in contact: of a coarser grid, or more than in contact."""
    zeros, z = search.grid.vectors.zeros, search.z
    if search.force is not None:
        everywhere = search.total / prod(search.grid.shape)
        if everywhere >= search.most * (1.0 - AT_HARDNESS):
            return zeros(z) + search.most, zeros(z, bool)
    coarse = _coarser(search) if nested else None
    if coarse is not None:
        products = Products(coarse.matrix, COARSE_PRODUCTS)
        state = _search_from(coarse, products, *_first_guess(coarse, nested=True))
        search.inverse.is_slow = coarse.inverse.is_slow
        p = _interpolate(search, state, search.unit / coarse.unit)
        if search.grid.vectors.count(p):
            return p, search.set_of(p)
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


def _press_all_but_few(search: Search, A: Products) -> tuple[Array | None, tuple[int, ...]]:
    """Find the pressures, to the tolerance or nearly so, where few elements are apart.

    They are None where many are, or the exchange is not possible. The iterations are returned too.
    Products with K count as those with A.
    """
    grid, z, vectors = search.grid, search.z, search.grid.vectors
    is_free = search.hardness == np.inf and grid.has_free_mean
    if search.force is None or not is_free or search.inverse.dtype != np.float32:
        return None, ()
    # Full contact varies the pressures by E*|q|/2 of a wave with a wavenumber q, and so by E*/2 of
    # its slopes. Where that is more than their mean, those of many elements pull.
    slopes = (np.diff(z, axis=axis) / h for axis, h in enumerate(grid.element))
    square = sum(vectors.dot(slope, slope) for slope in slopes) / z.size
    deviation = 0.5 * grid.material.E_star * np.sqrt(square)
    if search.force < FULL * deviation * grid.area * z.size:
        return None, ()
    K, scale = grid.scaled_inverse()
    products, scale = Products(K, A.limit - A.count), -scale * search.unit
    approach = -search.total / prod(grid.shape)
    z = products(z) * scale
    roles = (K, A.A.astype(np.float32))
    tolerance = search.tolerance
    depth = approach - vectors.min(z)
    if depth > 0.0:
        # A wrong pressure moves its element by about as much, and the interference is the mean gap.
        tolerance *= PART * vectors.sum(search.z) / (prod(grid.shape) * depth)
    other = Search(grid, z, approach, None, tolerance, search.progress, exchanged=roles)
    w, C = np.zeros(z.shape), z < approach
    now, _, iterations = find_set(other, products, w, C, eta=_eta(search))
    A.count += products.count
    return np.where(now.p > 0.0, 0.0, np.maximum(now.u + z - approach, 0.0)), iterations


class Known(NamedTuple):
    """Pressures under a load, in the units of the search, and the gap that they leave."""

    load: float  # Force or approach.
    p: Array
    gap: Array


def predict(known: Sequence[Known], load: float, vectors: Vectors) -> Array | None:
    """Return pressures under another load, or None where those that are known say nothing.

    The last two loads count. With one of them, its pressures are returned.
    """
    last = known[-1]
    if not vectors.count(last.p):
        return None
    before = next((k for k in reversed(known[:-1]) if k.load != last.load), None)
    if before is None or not vectors.count(before.p):
        return last.p
    edge = EDGE * vectors.sum(last.p) / vectors.count(last.p)
    now, then = (_straighten(k, edge) for k in (last, before))
    part = (load - last.load) / (last.load - before.load)
    p: Array = np.sqrt(np.maximum(now + part * (now - then), 0.0))
    return p if vectors.count(p) else None


def _straighten(known: Known, edge: float) -> Array:
    """Return a field that is linear in the distance from the edge of the contact."""
    # Where there is no material the gap is infinite, and nothing is to be extrapolated.
    gap = np.where(known.gap < np.inf, np.maximum(known.gap, 0.0), 0.0)
    opening = np.cbrt(edge**2 * gap) ** 2
    return np.where(known.p > 0.0, known.p**2, -opening)
