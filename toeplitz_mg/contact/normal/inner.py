"""Conjugate gradients on a set of elements in contact, in single precision.

They find changes of the pressures and the displacements with the relative accuracy of single
precision, in half the time. `search` adds the changes up in double precision, and recomputes the
product before it accepts a solution.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Multiply
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.normal.part import Part, Whole
from toeplitz_mg.contact.products import Products
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.vectors import Vectors

REDUCTION = 1e-5  # Largest reduction of the misfit in single precision.
FAR = 1e30  # Largest misfit; single precision ends at 1e38.
ANSWER = 0.9  # Share of the tolerance for a solution in single precision.
SHARP = 0.1  # No set is solved more accurately than this share of the tolerance.
LONG = 50  # After so many iterations the recurrence in single precision is not trusted.


class Area:
    """Elements with free pressure, with a mask to multiply by, which is faster than an index.

    Of the other elements, those that yield have the largest pressure: they may penetrate, but not
    open.
    """

    def __init__(
        self, C: Array, dtype: DTypeLike, vectors: Vectors, yields: Array | None = None
    ) -> None:
        self.mask = vectors.elementwise(lambda C: vectors.cast(C, dtype), C)
        self.size = vectors.count(C)
        self.vectors = vectors
        self.yields = yields
        self.side = None if yields is None else 1.0 - 2.0 * vectors.cast(yields, dtype)

    def mean(self, x: Array) -> float:
        """Return the mean of a field on the elements."""
        return self.vectors.dot(x, self.mask) / self.size

    def approach(self, x: Array) -> float:
        """Return the approach for a gap: its mean in contact, or one that suits the others."""
        if self.size or self.yields is None:
            return self.mean(x)
        where = self.vectors.xp.where
        above = -self.vectors.min(where(self.yields, -x, np.inf))
        below = self.vectors.min(where(self.yields, np.inf, x))
        if above <= below:  # Yielding elements are below, those that do not touch are above.
            return above if above > -np.inf else below
        return 0.5 * (above + below)


class Look(NamedTuple):
    """The errors of some pressures and a set of elements in contact."""

    gap: Array
    r: Array  # Minus the gap in contact, zero elsewhere.
    mean: float  # The mean gap in contact that was subtracted, if the approach is free; else 0.
    lowest: float  # The smallest gap, or minus the largest where elements yield.
    misfit: float  # The largest absolute gap in contact.
    tension: float  # The largest excess of a pressure, below zero or above the hardness.
    violation: float  # The error of the set: the tension, or the penetration elsewhere.
    error: float  # The complementarity error, at an approach without penetration if that is free.

    @classmethod
    def at(
        cls, p: Array, gap: Array, area: Area, *, balanced: bool, room: Array | None = None
    ) -> Self:
        """Examine pressures and their gap; if the approach is free, the gap minus its mean.

        `room` is the difference of the hardness and the pressures, if there is a hardness.
        """
        mean, vectors = 0.0, area.vectors
        xp, elementwise = vectors.xp, vectors.elementwise
        if balanced:
            mean = area.approach(gap)
            gap = elementwise(lambda g: g - mean, gap)
        r = elementwise(lambda g, in_contact: -(g * in_contact), gap, area.mask)
        low, high = -vectors.max(r), -vectors.min(r)
        elsewhere = elementwise(xp.add, gap, r)
        if area.side is not None:
            elsewhere = elementwise(xp.multiply, elsewhere, area.side)
        least = vectors.min(elsewhere)
        lowest, tension = min(low, least), max(0.0, -vectors.min(p))
        if room is not None:
            tension = max(tension, -vectors.min(room))
        misfit, violation = max(high, -low), max(tension, -least)
        # If some elements may penetrate, a change of the approach does not remove penetration.
        is_free = balanced and room is None
        error = max(high - lowest, tension) if is_free else max(misfit, violation)
        return cls(gap, r, mean, lowest, misfit, tension, violation, error)


class Change(NamedTuple):
    """A change of pressures and displacements, and the resulting gap, on a part."""

    p: Array
    u: Array
    gap: Array  # The resulting gap, scaled.
    is_solved: bool  # Whether the set is solved accurately enough for it, and is not a solution.
    iterations: int


def solve_on_set(
    A: Products,
    M: Inverse,
    C: Array,
    p: Array,
    now: Look,
    *,
    part: Part | Whole | None,
    most: float,
    eta: float,
    tolerance: float,
    balanced: bool,
) -> Change:
    """Solve on a set C of elements in contact, only as accurately as the set deserves.

    Parameters
    ----------
    A, M : Products, Inverse
        Products with a matrix with unit diagonal, and an approximate inverse on the set.
    p, now : ndarray, Look
        The initial pressures, and their errors.
    part : Part, Whole or None
        The elements to examine, which include the set; the results are restricted to them. None
        means all.
    most : float
        The hardness, or infinity.
    eta, tolerance : float
        The misfit to leave, relative to the violation of the set, and the complementarity error
        that is sufficient.
    balanced : bool
        Whether the sum of the pressures is given: then the sum of the change is zero, and the
        approach is free.
    """
    vectors, gap = A.vectors, now.gap
    xp, elementwise = vectors.xp, vectors.elementwise
    multiply: Multiply = A
    invert: Multiply = M
    if part is not None:
        C, p, gap = part.cut(C), part.cut(p), part.cut(gap)
        multiply, invert = part.restrict(A, M.dtype), part.restrict(M, M.dtype)
    is_bounded = most < np.inf
    area = Area(C, M.dtype, vectors, (p == most) & ~C if is_bounded else None)
    unit = max(now.misfit, tolerance)

    def scale(x: Array) -> Array:
        return vectors.cast(xp.clip(x * (1.0 / unit), -FAR, FAR), M.dtype)

    p0, gap0 = (elementwise(scale, x) for x in (p, gap))
    room0 = scale(most - p) if is_bounded else None
    v, Av = (vectors.zeros(p, M.dtype) for _ in range(2))

    def precondition(r: Array, out: Array) -> Array:
        y = invert(r, out)
        mean = area.mean(y) if balanced else 0.0
        return elementwise(lambda y, in_contact: (y - mean) * in_contact, y, area.mask, out=out)

    def add(p: Array, gap: Array) -> tuple[Array, Array]:
        return elementwise(xp.add, p, v), elementwise(xp.add, gap, Av)

    iteration = ConjugateGradients(multiply, precondition, vectors)
    count = 0
    while True:
        room = None if room0 is None else room0 - v
        look = Look.at(*add(p0, gap0), area, balanced=balanced, room=room)
        is_answer = look.tension == 0.0 and look.error <= ANSWER * tolerance / unit
        is_solved = look.misfit <= max(eta * look.violation, SHARP * tolerance / unit)
        if is_answer or is_solved or look.misfit <= REDUCTION or count == LONG or A.exhausted:
            break
        length = iteration.step(look.r)
        if length == 0.0:
            break  # The rest is lost in rounding.
        v = vectors.axpy(length, iteration.direction, v)
        Av = vectors.axpy(length, iteration.product, Av)
        count += 1
    dp, du = (elementwise(lambda x: vectors.cast(x, np.float64) * unit, x) for x in (v, Av))
    if balanced:
        dp = xp.where(C, dp - vectors.sum(dp) / area.size, dp)
    return Change(dp, du, look.gap, is_solved and not is_answer, count)
