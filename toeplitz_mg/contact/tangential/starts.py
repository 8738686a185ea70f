"""Where the search for the steady state of rolling starts: from the leading edge, or from sliding.

*From the leading edge backwards*, as Kalker's simplified theory does: from one element to the next
the tractions grow as they would without slip, and where they exceed the bound they are cut to it.

*From bodies that slide*, where loads are given and friction carries little more. There the loads
hardly depend on how large the creepages are, and creepages that grow step by step are taken back
wherever elements turn out to stick. But where all slides the tractions are g times the direction of
minus the slip, b + Uξ - u (Eq. 3), so that of displacements u that are known the creepages ξ follow
from the loads, a few equations without any product. The displacements are those of the tractions of
before: at first there are none where the slip is large that is given in b, and else those of
sliding by the creepages of which the loads would be the largest.

Elements that stick are found from here one after the other. On a line where some do the solution
on the next coarser grid is the better start: from there 1 of 1,300 lines takes more than 2.5 times
the products of given creepages, and from here 1 of 60. On a surface slip may turn around the
elements that stick, which are others on a coarser grid.
"""

from collections.abc import Iterable

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.law import Areas, Problem, admit, direction, size
from toeplitz_mg.contact.tangential.loads import Complement, Loads, inner_products
from toeplitz_mg.engine.vectors import Vectors

# Part of the bound beyond which elements are taken to slide, where some exceed it: tractions that
# are cut elsewhere are carried by others.
NEARLY = 0.6
NEAR = 0.9  # Part of the loads that friction carries beyond which little sticks.
# What the loads lack of that, over what an element carries, below which hardly an element sticks.
HARDLY = 0.1
# Slip that no unknown creepage takes away, over what the bound displaces in an element by itself,
# beyond which little sticks.
FAST = 4.0
ROUNDS = 3  # Most products.
SETTLED = 0.03  # Change of the tractions, over the largest bound, after which there is no more.
# Such a change beyond which the displacements follow by that part only: where some elements nearly
# stick, tractions there turn to and fro.
WILD, DAMPED = 0.5, 0.5
# Creepages of much load, over those of the slip that there is, from which a root is searched for.
FACTORS = 3.0, 10.0, 30.0, 1.0, 100.0
# Loads that are missing, over what an element carries of them, where it is an element that sticks:
# slip turns around it, and no sliding tractions have the loads.
STICKING = 1.0
MOST = 100  # Evaluations of the equations from each of those.


def roll_backwards(bonded: Array, g: Array) -> tuple[Array, Array]:
    """Return tractions that grow as those without slip, within the bound, and where they slide.

    Those without slip are `bonded`, and g is the bound.
    """
    q = bonded[0] if len(bonded) == 1 else bonded[0] + 1j * bonded[1]  # In the plane.
    growth = q.copy()
    growth[:-1] -= q[1:]
    now, sizes = np.zeros_like(q[0]), np.empty(g.shape)
    for i in range(len(g) - 1, -1, -1):
        now = now + growth[i]
        of_row = np.abs(now, out=sizes[i, ...])
        exceeds = of_row > g[i]
        now = now * np.divide(g[i], of_row, where=exceeds, out=np.ones(of_row.shape))
        q[i] = now
    slide = sizes > g
    if slide.any():
        slide = sizes > NEARLY * g
    return (q[None] if len(bonded) == 1 else np.stack([q.real, q.imag])), slide


def guess_sliding(
    problem: Problem, loads: Loads, K: Products, *, only_start: bool
) -> tuple[Array, Areas] | None:
    """Return tractions and areas to start from; None where some elements stick for certain.

    `only_start` says that there is no other start, as that from a coarser grid where some stick.
    """
    vectors, g, inside = problem.vectors, problem.g, problem.g > 0.0
    if vectors.count(np.isinf(g)) or not (loads.carried(g, vectors) > 0.0).all():
        return None
    if vectors.count(g) == 1:  # It sticks, as it carries the loads.
        return None
    least = NEAR if only_start else 1.0 - HARDLY / vectors.count(g)
    units, b = (np.where(inside, x, 0.0) for x in (loads.units, problem.b))
    of_slip = Complement(units, vectors)
    of_element = problem.grid.diagonal(K.A) * vectors.dot(g, g)
    is_fast = vectors.sum(g * size(of_slip(b))) > FAST * of_element
    if not (is_fast or loads.share(g, vectors) > least):
        return None
    share, slip = loads.find_limit(g, vectors)
    if not (is_fast or least < share < 1.0):
        return None
    ahead, largest = of_slip.coordinates(slip), vectors.max(size(slip)) or 1.0

    def starts(rest: Array) -> Iterable[Array]:
        nearest, much = -of_slip.coordinates(rest), ahead * (vectors.max(size(rest)) / largest)
        yield from (nearest,) if is_fast else ()
        yield from (nearest + factor * much for factor in FACTORS)

    def slide(rest: Array, creepages: Array) -> Array:
        return g * direction(rest + vectors.combine(creepages, units))

    q, u, change, creepages = g * direction(slip), np.zeros_like(b), 0.0, None
    if is_fast:
        if (creepages := _find_creepages(loads, g, units, b, starts(b), vectors)) is None:
            return None
        q = slide(b, creepages)
    for _ in range(ROUNDS):
        if K.exhausted:
            break
        u = u + (DAMPED if change > WILD else 1.0) * (np.where(inside, K(q), 0.0) - u)
        near = starts(b - u) if creepages is None else (creepages,)
        found = _find_creepages(loads, g, units, b - u, near, vectors)
        if found is None:
            break
        before, q, creepages = q, slide(b - u, found), found
        change = vectors.max(size(q - before)) / vectors.max(g)
        if change < SETTLED:
            break
    if creepages is None:
        return None
    if len(q) == 1:
        # Tractions of sliding along x alone are those of any creepage, so an element sticks.
        length = np.where(inside, size(b - u + vectors.combine(creepages, units)), np.inf)
        inside &= length > -vectors.max(-length)
    return admit(problem, q, inside)


def _find_creepages(
    loads: Loads, g: Array, units: Array, rest: Array, starts: Iterable[Array], vectors: Vectors
) -> Array | None:
    """Return creepages by which sliding tractions have the loads, from some near by, if any."""
    from scipy.optimize import root  # It is slow to import.

    carried = loads.carried(g, vectors)
    elements = vectors.count(g)
    lengths = np.array([vectors.sum(g * size(unit)) for unit in units])
    of_rest = vectors.sum(g * size(rest)) or 1.0
    # In units of creepages that slip as much as there is.
    scale = of_rest / np.where(lengths > 0.0, lengths, 1.0)

    def miss(x: Array) -> Array:
        q = g * direction(rest + vectors.combine(x * scale, units))
        missing: Array = (inner_products(loads.arms, q, vectors) - loads.wanted) / carried
        return missing

    for start in starts:
        found = root(miss, start / scale, options={"maxfev": MOST})
        if found.success or np.abs(found.fun).max() * elements < STICKING:
            creepages: Array = found.x * scale
            return creepages
    return None
