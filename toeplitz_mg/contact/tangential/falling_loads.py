"""Loads that are given where friction depends on the slip, by a search for their creepages.

The bound of bodies that do not slip may carry less than that of the answer, as with a film of oil,
which carries nothing then. So the creepages are given instead, for which there is an answer, and
those are looked for whose loads are the given ones. Creepage lowers the load. The search begins
without any, so that of the creepages with this load, where friction falls, it finds the least.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.results import ContactError, TangentialResult, check_converged
from toeplitz_mg.contact.tangential.coulomb import size
from toeplitz_mg.contact.tangential.falling import Rounds, factor_of, fall, size_of_slip
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.motion import LOADS, Motion

SLIPS = np.geomspace(1e-8, 1e4, 193)  # Slips over the distance rolled that friction is tried at.
FIRST_STEP = 0.5  # In creepages at which sliding bodies carry the loads.
STEPS = 40  # Steps of the bracket, each twice as long.
ACCURATE = 10.0  # Tolerances that may be missing of a load, of what is carried either way.


class _Ends(Exception):
    """The loads are those that are given, or no product is left."""


class _Beyond(Exception):
    """A creepage carries more than the load that is given."""


def fall_by_loads(
    rounds: Rounds,
    motion: Motion,
    grid: Any,
    g: Array,
    falling: Callable[[Array], ArrayLike],
    stiffness: float,
    tolerance: float,
) -> TangentialResult:
    """Return the result with the loads of the motion, whose bound belongs to its slip.

    The arguments are those of `fall`, but for the motion and the grid.
    """
    from scipy.optimize import brentq, root  # They are slow to import.

    grid, vectors = replace(grid, directions=motion.directions), grid.vectors
    loads = Loads(-grid.element[0] * motion.units(grid), motion.arms(grid), motion.wanted)
    most = g * np.max([factor_of(falling, np.full(g.shape, s)) for s in (0.0, *SLIPS)], axis=0)
    motion.check_loads(grid, most, "the friction of any slip")
    loads.check_share(most, vectors, "the friction of any slip")
    units, towards, scale = _scale(motion, grid, g, falling, stiffness)
    field = _slip_of(motion, grid, g)
    last: TangentialResult | None = None
    best: tuple[float, TangentialResult | None] = np.inf, None

    def miss(x: Array) -> Array:
        nonlocal last, best
        if rounds.report.exhausted:
            raise _Ends
        creepages = motion.complete(x * units)
        given = np.pad(creepages, (0, 3 - len(creepages))).tolist()
        asked = given, None, None, field, motion.pole
        slip = None if last is None else size_of_slip(last)
        found = fall(rounds, asked, g, falling, stiffness, last, tolerance, slip)
        if best[1] is not None and rounds.report.exhausted and found.residual > tolerance:
            raise _Ends  # What is nearest has been found before.
        last = check_converged(found, tolerance)
        q = last.traction.reshape(grid.components, *g.shape)
        error = loads.error(q, vectors)
        if error < best[0]:
            best = error, last
        if error <= ACCURATE * tolerance:
            raise _Ends
        return loads.missing(q, vectors) / scale

    @cache
    def miss_one(x: float) -> float:
        return float(miss(np.array([x]))[0])

    with suppress(_Ends):
        if len(units) > 1:
            root(miss, towards, options={"factor": FIRST_STEP, "eps": 1e-4, "xtol": 1e-12})
        elif bracket := _bracket(miss_one):
            brentq(miss_one, *bracket, xtol=1e-14)
    error, result = best
    assert result is not None
    result = replace(result, products=rounds.report.products, work=rounds.work)
    if error > ACCURATE * tolerance:
        q = result.traction.reshape(grid.components, *g.shape)
        raise _refuse(motion, motion.wanted - loads.missing(q, vectors), error, tolerance, result)
    return result


def _slip_of(motion: Motion, grid: Any, g: Array) -> Array | None:
    """Return the field of rigid slip that is given, as one who asks for a motion gives it."""
    if g.ndim == 1 and motion.slip is None and grid.components == 2:
        return np.zeros((2, *g.shape))  # Then tractions have both components, by any creepage.
    if g.ndim == 1 and motion.slip is not None and len(motion.slip) == 1:
        field: Array = motion.slip[0]
        return field
    return motion.slip


def _refuse(
    motion: Motion, found: Array, error: float, tolerance: float, result: TangentialResult
) -> ContactError:
    """Return the error that says how near the loads that were found are."""
    names = ", ".join(
        f"{LOADS[k]} is to be {a:.6g}, and {b:.6g} is the nearest that was found"
        for k, a, b in zip(motion.unknown, motion.wanted, found, strict=True)
    )
    return ContactError(
        f"after {result.products} products {error:.1e} of a load is missing, but at most "
        f"{ACCURATE:g} times the tolerance of {tolerance:g} may be: {names}",
        result,
    )


def _scale(
    motion: Motion, grid: Any, g: Array, falling: Callable[[Array], ArrayLike], stiffness: float
) -> tuple[Array, Array, Array]:
    """Return creepages that are about those of the loads, where they lead, and their loads."""
    vectors, finite = grid.vectors, np.where(np.isfinite(g), g, 0.0)
    fields, arms = motion.units(grid), motion.arms(grid)
    lengths = np.array([vectors.max(np.where(g > 0.0, size(unit), 0.0)) for unit in fields])
    carried = np.array([vectors.sum(finite * size(arm)) for arm in arms])
    towards = motion.wanted / carried
    towards /= np.linalg.norm(towards)
    v = size(vectors.combine(towards / lengths, fields))
    # The power of sliding bodies is that of their loads.
    powers = [grid.area * vectors.sum(finite * factor_of(falling, c * v) * v) for c in SLIPS]
    enough = np.array(powers) >= float(motion.wanted @ (towards / lengths))
    k = int(np.argmax(enough if enough.any() else powers))
    bound = finite * factor_of(falling, SLIPS[k] * v)
    # Beside what slides, the bodies yield.
    creepage = SLIPS[k] + vectors.max(bound) / stiffness
    scale = np.array([vectors.sum(bound * size(arm)) for arm in arms])
    return creepage / lengths, -towards, scale


def _bracket(miss: Callable[[float], float]) -> tuple[float, float] | None:
    """Return creepages with too little and with too much of the load, the least, or None."""
    from scipy.optimize import minimize_scalar  # It is slow to import.

    sign = 1.0 if miss(0.0) > 0.0 else -1.0
    before, last, step = 0.0, 0.0, FIRST_STEP
    beyond = 0.0

    def lack(x: float) -> float:
        nonlocal beyond
        beyond = float(x)
        if (left := sign * miss(beyond)) < 0.0:
            raise _Beyond
        return left

    for _ in range(STEPS):
        try:
            if lack(last - sign * step) >= lack(last):  # The most is carried between.
                ends = sorted((before, last - sign * step))
                minimize_scalar(lack, bounds=ends, method="bounded", options={"xatol": 1e-3})
                return None
        except _Beyond:
            return (last if abs(beyond) > abs(last) else before), beyond
        before, last, step = last, last - sign * step, 2.0 * step
    return None
