"""Creepages for given loads, found by root finding over steady states.

This is the last resort if tractions, areas and creepages do not converge together: if little
sticks, so that few elements determine the creepages; and if friction without slip does not carry
the loads, as with a lubricant. For given creepages there is always a steady state, whose loads
depend on them. A single creepage is bracketed; if friction falls, the smallest one with this load
is sought. For two or three, Powell's hybrid method is used.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import ContactError, TangentialResult
from toeplitz_mg.contact.tangential.falling import follow
from toeplitz_mg.contact.tangential.law import Problem, State, direction, size
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.engine.vectors import VECTORS

FIRST_STEP = 0.1  # Largest first step, relative to creepages at which the bodies slide.
STEPS = 40  # Steps of the bracket, each twice as long as the one before.
SLIPS = np.geomspace(1e-8, 1e4, 193)  # Slips over the distance rolled at which friction is tried.

ACCURATE = 10.0  # Allowed error, in tolerances, of a load that only friction with slip carries.

# Maps creepages, and a state near by, to their steady state.
Solve = Callable[[Array, State | None], State]


class _Ends(Exception):
    """The loads are accurate enough, or no state was found."""


class _Beyond(Exception):
    """A creepage carries more than the given load."""


def search_creepages(
    problem: Problem,
    loads: Loads,
    K: Products,
    solve: Solve,
    state: State | None,
    creepages: Array,
    accuracy: float,
    slides: tuple[Array, Array] | None = None,
) -> tuple[State, Array]:
    """Return a steady state with loads near the given ones, and its creepages.

    The search starts from creepages and a state near them. The relative error of a load may be
    `accuracy`. `slides` are the creepages at which bodies slide, and the bound there, if known.
    """
    from scipy.optimize import brentq, root  # Slow to import.

    vectors = problem.vectors
    if slides is None:  # The slip displaces as much as the tractions of sliding bodies.
        lengths = [vectors.max(size(unit)) for unit in loads.units]
        yields = [vectors.max(size(K(problem.g * direction(unit)))) for unit in loads.units]
        slides = np.array(yields) / lengths, problem.g
    units, bound = slides
    carried = loads.carried(bound, vectors)
    best: tuple[State | None, Array, float] = state, creepages, np.inf

    def miss(x: Array) -> Array:
        nonlocal state, best
        state = solve(x * units, state)
        error = loads.error(state.q, vectors)
        is_settled = state.residual <= problem.tolerance or problem.falling is None
        if best[0] is None or (error < best[2] and is_settled):
            best = state, x * units, error
        if error <= accuracy or K.exhausted or not is_settled:
            raise _Ends
        missing: Array = loads.missing(state.q, vectors) / carried
        return missing

    @cache  # Another initial state changes the rounding, and at zero the sign.
    def miss_one(x: float) -> float:
        return float(miss(np.array([x]))[0])

    with suppress(_Ends):
        if len(units) > 1:
            options = {"factor": FIRST_STEP, "eps": 1e-4, "xtol": 1e-12}
            root(miss, creepages / units, options=options)
        elif ends := _bracket(miss_one, float(creepages[0] / units[0]), problem.falling is None):
            brentq(miss_one, *ends, xtol=1e-14)
    assert best[0] is not None
    return best[0], best[1]


def _bracket(
    miss: Callable[[float], float], first: float, grows: bool
) -> tuple[float, float] | None:
    """Return the closest creepages with too little and too much of the load, or None.

    If friction does not fall, the load grows with the creepage up to rounding.
    """
    from scipy.optimize import minimize_scalar  # Slow to import.

    sign = 1.0 if miss(first) > 0.0 else -1.0
    before = last = beyond = first
    step = FIRST_STEP

    def lack(x: float) -> float:
        nonlocal beyond
        beyond = float(x)
        if (left := sign * miss(beyond)) < 0.0:
            raise _Beyond
        return left

    for _ in range(STEPS):
        try:
            if lack(last - sign * step) >= lack(last) and not grows:  # The maximum lies between.
                ends = sorted((before, last - sign * step))
                minimize_scalar(lack, bounds=ends, method="bounded", options={"xatol": 1e-3})
                return None
        except _Beyond:
            return (last if abs(beyond - first) > abs(last - first) else before), beyond
        before, last, step = last, last - sign * step, 2.0 * step
    return None


def roll_by_creepages(
    find: Callable[..., State],
    problem: Problem,
    loads: Loads,
    creepages: Array,
    state: State | None,
) -> State:
    """Return the steady state for creepages instead of loads, starting from one near by."""
    problem = replace(problem, b=problem.b + problem.vectors.combine(creepages, loads.units))
    # Without slip the tractions are zero, so no guess is needed.
    guess = (state.q, state.areas) if state and problem.largest > 0.0 else None
    return find(problem, Loads(loads.units[:0], loads.arms[:0], loads.wanted[:0]), guess)


def find_by_slip(find: Callable[..., State], K: Products, problem: Problem, loads: Loads) -> State:
    """Return the steady state for loads that friction without slip does not carry."""
    solve = partial(roll_by_creepages, partial(follow, find, K), problem, loads)
    start, slides = _guess_creepages(problem, loads)
    accuracy = ACCURATE * problem.tolerance
    state, creepages = search_creepages(problem, loads, K, solve, None, start, accuracy, slides)
    return replace(state, shift=creepages)


def check_loads(
    names: Sequence[str], loads: Loads, q: Array, result: TangentialResult, tolerance: float
) -> None:
    """Raise an error, which says how close they are, unless tractions q have the given loads."""
    missing, error = loads.missing(q, VECTORS), loads.error(q, VECTORS)
    if error > ACCURATE * tolerance:
        found = ", ".join(
            f"{name} must be {a:.6g}, and the nearest found is {a - b:.6g}"
            for name, a, b in zip(names, loads.wanted, missing, strict=True)
        )
        raise ContactError(
            f"after {result.products} products a load is missed by {error:.1e} of it, but at most "
            f"{ACCURATE:g} times the tolerance of {tolerance:g} is allowed: {found}",
            result,
        )


def _guess_creepages(problem: Problem, loads: Loads) -> tuple[Array, tuple[Array, Array]]:
    """Return initial creepages, the creepages at which bodies slide, and the bound there.

    A search for a single creepage starts from zero, so that it finds the smallest.
    """
    law = problem.falling
    assert law is not None
    vectors, inside = problem.vectors, problem.g > 0.0
    finite = np.where(np.isfinite(problem.g), problem.g, 0.0)
    lengths = np.array([vectors.max(np.where(inside, size(unit), 0.0)) for unit in loads.units])
    towards = loads.wanted / loads.carried(finite, vectors)
    towards /= np.linalg.norm(towards)
    # The power of sliding bodies is that of their loads.
    v = size(vectors.combine(towards / lengths, loads.units))
    powers = [vectors.sum(np.where(inside, law.at(c * v), 0.0) * v) for c in law.h * SLIPS]
    wanted = law.h / problem.grid.area * float(loads.wanted @ (towards / lengths))
    enough = np.array(powers) >= wanted
    slip = law.h * SLIPS[int(np.argmax(enough if enough.any() else powers))]
    bound = np.where(np.isfinite(problem.g), law.at(slip * v), 0.0)
    # In addition to sliding, the bodies deform.
    units = (slip + law.k0 * vectors.max(bound)) / lengths
    return (-towards * units if len(units) > 1 else 0.0 * units), (units, bound)
