"""Initial guesses for steady rolling: from the leading edge, or from sliding.

*From the leading edge backwards*, as in Kalker's simplified theory: from one element to the next
the tractions grow as they would without slip, and are cut to the bound where they exceed it.

*From bodies that slide*, if loads are given and close to what friction can carry. There the loads
hardly depend on the magnitude of the creepages, and creepages that grow step by step would be taken
back whenever elements turn out to stick. If all elements slide, the tractions are g times the
direction of minus the slip, b + Uξ - u (Eq. 3). For known displacements u, the creepages ξ then
follow from the loads, by a few equations without any product. The displacements are those of the
previous tractions: at first zero if the slip given in b is large, otherwise those of sliding by the
creepages with the largest loads.

From here, elements that stick are found one after the other. For line contacts in which some stick,
the solution on the next coarser grid is a better start: 1 of 1,300 cases takes more than 2.5 times
the products of given creepages, instead of 1 of 60. On a surface, slip may turn around the sticking
elements, which differ on a coarser grid.
"""

from collections.abc import Iterable

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.law import Areas, Problem, admit, direction, size
from toeplitz_mg.contact.tangential.loads import Complement, Loads, inner_products
from toeplitz_mg.engine.vectors import Vectors

# If some elements exceed the bound, those above this share of it are taken to slide, since they
# carry what is cut elsewhere.
NEARLY = 0.6
NEAR = 0.9  # Above this share of the friction limit, loads leave little that sticks.
# If loads lack less than this share of an element's load to the limit, hardly an element sticks.
HARDLY = 0.1
# If the slip that no unknown creepage can cancel, over the displacement of an element by its bound,
# exceeds this, little sticks.
FAST = 4.0
ROUNDS = 3  # Limit of products.
SETTLED = 0.03  # Change of the tractions, over the largest bound, at which the iteration ends.
# Above this change the displacements are damped: where elements nearly stick, their tractions
# oscillate.
WILD, DAMPED = 0.5, 0.5
# Initial creepages for root finding, over those that cause the present slip.
FACTORS = 3.0, 10.0, 30.0, 1.0, 100.0
# If the missing loads exceed this share of an element's load, that element sticks: slip turns
# around it, and no sliding tractions have the loads.
STICKING = 1.0
MOST = 100  # Evaluations of the equations for each initial value.


def roll_backwards(bonded: Array, g: Array) -> tuple[Array, Array]:
    """Return tractions that grow as without slip, within the bound, and the elements that slide.

    `bonded` are the tractions without slip, g is the bound.
    """
    q = bonded[0] if len(bonded) == 1 else bonded[0] + 1j * bonded[1]  # As complex numbers.
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
    """Return initial tractions and areas, or None if some elements certainly stick.

    `only_start` says that there is no other initial guess, such as from a coarser grid.
    """
    vectors, g, inside = problem.vectors, problem.g, problem.g > 0.0
    if vectors.count(np.isinf(g)) or not (loads.carried(g, vectors) > 0.0).all():
        return None
    if vectors.count(g) == 1:  # A single element carries the loads, so it sticks.
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
        # Tractions of sliding along x only do not depend on the creepage, so an element sticks.
        length = np.where(inside, size(b - u + vectors.combine(creepages, units)), np.inf)
        inside &= length > -vectors.max(-length)
    return admit(problem, q, inside)


def _find_creepages(
    loads: Loads, g: Array, units: Array, rest: Array, starts: Iterable[Array], vectors: Vectors
) -> Array | None:
    """Return creepages for which sliding tractions have the loads, or None."""
    from scipy.optimize import root  # Slow to import.

    carried = loads.carried(g, vectors)
    elements = vectors.count(g)
    lengths = np.array([vectors.sum(g * size(unit)) for unit in units])
    of_rest = vectors.sum(g * size(rest)) or 1.0
    # In units of creepages that cause the present slip.
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
