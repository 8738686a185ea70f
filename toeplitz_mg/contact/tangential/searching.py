"""Creepages for given loads, from the loads of the steady states of some.

This is for where tractions, areas and creepages do not settle all at once: where little sticks,
few elements say what the creepages are. Of given creepages there is always a steady state, and its
loads depend on them. One creepage is bracketed: it lowers the load. Of two or three, on which
the loads depend smoothly, Powell's hybrid method does the rest.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import cache

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import size
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.problem import Problem, State

FIRST_STEP = 0.1  # Longest first step, in creepages that make the bodies slide.

# From creepages, and a state near by, to their steady state.
Solve = Callable[[Array, State], State]


class _NearEnough(Exception):
    """The loads are those that are given, to the accuracy, or no product is left."""


def search_creepages(
    problem: Problem,
    loads: Loads,
    K: Products,
    solve: Solve,
    state: State,
    creepages: Array,
    accuracy: float,
) -> tuple[State, Array]:
    """Return a steady state with loads near those that are given, and its creepages.

    Parameters
    ----------
    problem : Problem
    loads : Loads
    K : Products
        It says when no product is left.
    solve : callable
    state : State
        Near the first creepages.
    creepages : ndarray of shape (m,)
        Where to start from.
    accuracy : float
        Part of the load of sliding bodies that may be missing.
    """
    from scipy.optimize import brentq, root  # They are slow to import.

    vectors = problem.vectors
    carried = loads.carried(problem.g, vectors)
    units = np.array([_creepage_of_sliding(problem, K, unit) for unit in loads.units])
    best = state, creepages, np.inf

    def miss(x: Array) -> Array:
        nonlocal state, best
        state = solve(x * units, state)
        missing = loads.missing(state.q, vectors) / carried
        error = float(np.abs(missing).max())
        if error < best[2]:
            best = state, x * units, error
        if error <= accuracy or K.exhausted:
            raise _NearEnough
        return missing

    @cache  # Another state to start from gives another rounding, and at zero another sign.
    def miss_one(x: float) -> float:
        return float(miss(np.array([x]))[0])

    with suppress(_NearEnough):
        if len(units) == 1:
            brentq(miss_one, *_bracket(miss_one, float(creepages[0] / units[0])))
        else:
            root(miss, creepages / units, options={"factor": FIRST_STEP, "eps": 1e-4})
    return best[0], best[1]


def _bracket(miss: Callable[[float], float], before: float) -> tuple[float, float]:
    """Return creepages with too much and with too little of the load, which they lower."""
    step, missing = FIRST_STEP, miss(before)
    while True:
        beyond = before + (-step if missing > 0.0 else step)
        if (miss(beyond) > 0.0) != (missing > 0.0):
            return before, beyond
        before, step = beyond, 2.0 * step


def _creepage_of_sliding(problem: Problem, K: Products, unit: Array) -> float:
    """Return the creepage whose slip displaces as much as the tractions of bodies that slide."""
    length = size(unit)
    q = problem.g * unit / np.where(length > 0.0, length, 1.0)
    largest = problem.vectors.max
    return float(largest(size(K(q))) / largest(length))
