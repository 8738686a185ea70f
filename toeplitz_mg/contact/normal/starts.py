"""Initial guesses for the pressures: from other loads, nearly full contact, or coarser grids.

The first of these that is possible is used:

- Pressures under other loads are extrapolated. Near the edge of a contact they grow as the square
  root of the distance, and outside the gap grows as its power 3/2. So p² inside, and minus the gap
  to the power 2/3 outside, form one field that is nearly linear in the distance and in the load,
  which predicts the edge. Pressures by themselves do not tell which elements touch next.
- If a surface repeats and touches nearly everywhere, gap and pressure exchange their roles. The gap
  w under load has the pressures p = P + K (w - z), where P is their mean, given by the force, and K
  the inverse of A except for the mean. So the conditions w ≥ 0, p ≥ 0, w p = 0 again have the form
  of contact: with the matrix K, the gap -K z and the approach -P, w are the "pressures" and p is
  the "gap". The few elements that are apart are "in contact" in this problem.
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

ETA = 0.5  # Misfit left on a set, relative to its violation, while the energy decreases.
EXACT_ETA = 0.1  # The same if each set has its own FSAI, and needs few iterations.
FALL = 0.5  # If a step leaves a larger share of the error, the search starts.
ROUGH = 0.2  # Tolerance on a coarser grid, relative to the unresolved detail of the gap.
# Limits of the tolerance on a coarser grid: more and less accurate guesses save nothing.
LEAST, MOST = 1.5e-3, 1e-2
DAMPING = 0.5  # Damping of the Jacobi step by which pressures follow the detail of a finer grid.
COARSE_PRODUCTS = 200  # Limit of products on a coarser grid, which only gives an initial guess.
AT_HARDNESS = 1e-13  # If the force is this close to the largest one, all elements yield.
# Typical pressure near the edge of a contact over the mean: it determines how fast the gap opens.
EDGE = 0.5
PART = 0.5  # Share of the tolerance for the problem with exchanged gap and pressure.
# If the mean pressure in full contact is this multiple of the standard deviation, few elements are
# pulled apart: a tenth of them for normally distributed pressures.
FULL = 1.28


class State(NamedTuple):
    """Pressures, their displacements, the approach, and the cost."""

    p: Array
    u: Array
    approach: float
    residual: float = 0.0
    iterations: tuple[int, ...] = ()


def solve(search: Search, A: Products, *, nested: bool, guess: Array | None = None) -> State:
    """Find the pressures and the contact area, from a guess or, if `nested`, from coarser grids."""
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
    """Find the pressures from initial ones and a set; their displacements may be known."""
    now, law, iterations = find_set(search, A, p, C, u=u, eta=_eta(search))
    return State(now.p, now.u, law.touching, law.residual, iterations)


def _eta(search: Search) -> float:
    """Return the misfit to leave on the first sets."""
    return EXACT_ETA if search.inverse.is_slow else ETA


def _come_near(search: Search, A: Products, p: Array) -> Iterate:
    """Improve pressures that are nearly right, and above all their set, by a few steps.

    A step corrects the pressures by the approximate inverse, and clips those below zero. If the set
    is nearly right, it reduces the error to less than a fifth with one product; an iteration on the
    set and a change of it need two.
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
    """Correct pressures by the approximate inverse where they will be free (`Search.change`).

    As in conjugate gradients, the length of the previous step minimises the error, and the new
    direction is conjugate to it. Only the length of the last step is unknown; it is set to one.
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
    """Return initial pressures and a set: from a coarser grid, or with too many elements."""
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
    """Return the problem on a coarser grid, or None if that would not help."""
    grid = search.grid.coarser()
    if grid is None:
        return None
    z, vectors = search.grid.coarsen(search.z), search.grid.vectors
    if search.approach is not None and not grid.vectors.count(z < search.approach):
        return None  # The averages do not touch.
    detail = vectors.max(vectors.xp.abs(search.z - search.grid.refine(z)))
    detail /= vectors.max(search.z) - search.lowest or 1.0
    tolerance = min(max(LEAST, ROUGH * detail), MOST)
    progress = for_coarser_grids(search.progress)
    return Search(grid, z, search.approach, search.force, tolerance, progress, search.hardness)


def _interpolate(search: Search, coarse: State, ratio: float) -> Array:
    """Interpolate from a coarser grid, and correct for the detail that it cannot resolve.

    The correction is one step of Jacobi's iteration, which needs no product as displacements are
    smooth.
    """
    p, u = (search.grid.refine(x) for x in (coarse.p, coarse.u))
    vectors = search.grid.vectors
    p = ratio * p - DAMPING * (u + search.z - coarse.approach)
    p = vectors.xp.clip(p, 0.0, search.most)
    return search.clip(p) if vectors.count(p) else p


def _press_all_but_few(search: Search, A: Products) -> tuple[Array | None, tuple[int, ...]]:
    """Find the pressures, at least nearly to the tolerance, if few elements are apart.

    They are None if many are, or if roles cannot be exchanged. The iterations are returned too.
    Products with K count like those with A.
    """
    grid, z, vectors = search.grid, search.z, search.grid.vectors
    is_free = search.hardness == np.inf and grid.has_free_mean
    if search.force is None or not is_free or search.inverse.dtype != np.float32:
        return None, ()
    # In full contact the pressure of a wave with wavenumber q is E*|q|/2 times its amplitude, so
    # E*/2 times its slope. If that exceeds the mean pressure, many elements pull.
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
        # An error of a pressure moves its element by about as much; the interference is the mean
        # gap.
        tolerance *= PART * vectors.sum(search.z) / (prod(grid.shape) * depth)
    other = Search(grid, z, approach, None, tolerance, search.progress, exchanged=roles)
    w, C = np.zeros(z.shape), z < approach
    now, _, iterations = find_set(other, products, w, C, eta=_eta(search))
    A.count += products.count
    return np.where(now.p > 0.0, 0.0, np.maximum(now.u + z - approach, 0.0)), iterations


class Known(NamedTuple):
    """Pressures under a load, in the units of the search, and their gap."""

    load: float  # Force or approach.
    p: Array
    gap: Array


def predict(known: Sequence[Known], load: float, vectors: Vectors) -> Array | None:
    """Return pressures extrapolated to another load, or None if the known ones do not help.

    The last two loads are used. If there is only one, its pressures are returned.
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
    # The gap is infinite where there is no material; nothing is extrapolated there.
    gap = np.where(known.gap < np.inf, np.maximum(known.gap, 0.0), 0.0)
    opening = np.cbrt(edge**2 * gap) ** 2
    return np.where(known.p > 0.0, known.p**2, -opening)
