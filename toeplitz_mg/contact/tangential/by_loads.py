"""Creepages for given loads, from the loads of the steady states of some.

This is for where tractions, areas and creepages do not settle all at once: where little sticks,
few elements say what the creepages are; and where friction without any slip does not carry the
loads, as with a film of oil. Of given creepages there is always a steady state, and its loads
depend on them. One creepage is bracketed: it lowers the load, and where friction falls it is the
least with this load that is found. Of two or three, on which the loads depend smoothly, Powell's
hybrid method does the rest.
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

FIRST_STEP = 0.1  # Longest first step, in creepages that make the bodies slide.
STEPS = 40  # Steps of the bracket, each twice as long.
SLIPS = np.geomspace(1e-8, 1e4, 193)  # Slips over the distance rolled that friction is tried at.

ACCURATE = 10.0  # Tolerances that may be missing of a load that friction carries by its slip only.

# From creepages, and a state near by, to their steady state.
Solve = Callable[[Array, State | None], State]


class _Ends(Exception):
    """The loads are those that are given, to the accuracy, or no state is found."""


class _Beyond(Exception):
    """A creepage carries more than the load that is given."""


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
    """Return a steady state with loads near those that are given, and its creepages.

    The search starts from some creepages, and a state near them. Of a load the part `accuracy` may
    be missing. `slides`, each creepage by which bodies slide and the bound then, may be known.
    """
    from scipy.optimize import brentq, root  # They are slow to import.

    vectors = problem.vectors
    if slides is None:  # The slip displaces as much as the tractions of bodies that slide.
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

    @cache  # Another state to start from gives another rounding, and at zero another sign.
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
    """Return creepages with too little and with too much of the load, the nearest, or None.

    Where friction does not fall the load grows with the creepage, but for rounding.
    """
    from scipy.optimize import minimize_scalar  # It is slow to import.

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
            if lack(last - sign * step) >= lack(last) and not grows:  # The most is between.
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
    """Return the steady state of creepages in the place of loads, from one near by."""
    problem = replace(problem, b=problem.b + problem.vectors.combine(creepages, loads.units))
    # Without any slip there are no tractions: no guess is nearer.
    guess = (state.q, state.areas) if state and problem.largest > 0.0 else None
    return find(problem, Loads(loads.units[:0], loads.arms[:0], loads.wanted[:0]), guess)


def find_by_slip(find: Callable[..., State], K: Products, problem: Problem, loads: Loads) -> State:
    """Return the steady state with loads that friction without any slip does not carry."""
    solve = partial(roll_by_creepages, partial(follow, find, K), problem, loads)
    start, slides = _guess_creepages(problem, loads)
    accuracy = ACCURATE * problem.tolerance
    state, creepages = search_creepages(problem, loads, K, solve, None, start, accuracy, slides)
    return replace(state, shift=creepages)


def check_loads(
    names: Sequence[str], loads: Loads, q: Array, result: TangentialResult, tolerance: float
) -> None:
    """Refuse tractions q whose loads are not those that are given: say how near they come."""
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
    """Return where creepages of the loads begin, those at which bodies slide, and the bound then.

    The search for one begins without any, so that it finds the least.
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
    # Beside what slides, the bodies yield.
    units = (slip + law.k0 * vectors.max(bound)) / lengths
    return (-towards * units if len(units) > 1 else 0.0 * units), (units, bound)
