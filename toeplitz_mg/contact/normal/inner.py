"""Conjugate gradients on a set of elements in contact, in single precision.

They find a change of the pressures, and that of the displacements, with the relative accuracy of
single precision: products take half the time. `search` adds the changes up in double
precision, and multiplies the sum anew before it believes an answer.
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

REDUCTION = 1e-5  # Reduction of the misfit for which single precision is good.
FAR = 1e30  # Size of a misfit, beyond which no sign changes: single precision ends at 1e38.
ANSWER = 0.9  # Part of the tolerance that is left to an answer in single precision.
SHARP = 0.1  # Part of the tolerance beyond which no set is solved more exactly.
LONG = 50  # Iterations after which the recurrence in single precision is not trusted.


class Area:
    """Elements whose pressure is free, with a mask to multiply by: faster than to index by them.

    Of the other elements, those that yield carry all they can: they may penetrate, but not open.
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
        """Return the approach that belongs to a gap: its mean, or where it suits all others."""
        if self.size or self.yields is None:
            return self.mean(x)
        where = self.vectors.xp.where
        above = -self.vectors.min(where(self.yields, -x, np.inf))
        below = self.vectors.min(where(self.yields, np.inf, x))
        if above <= below:  # All that yield are below it, and all that do not touch are above.
            return above if above > -np.inf else below
        return 0.5 * (above + below)


class Look(NamedTuple):
    """What is wrong with some pressures and a set of elements in contact."""

    gap: Array
    r: Array  # Minus the gap in contact, zero elsewhere.
    mean: float  # The mean that the gap had in contact, where the approach is free; else 0.
    lowest: float  # The smallest gap, or minus the largest where elements yield.
    misfit: float  # The largest size of the gap in contact.
    tension: float  # The largest excess of a pressure, below zero or above the hardness.
    violation: float  # How wrong the set is: the tension, or the depth of penetration elsewhere.
    error: float  # The error of complementarity, at an approach, if free, without penetration.

    @classmethod
    def at(
        cls, p: Array, gap: Array, area: Area, *, balanced: bool, room: Array | None = None
    ) -> Self:
        """Look at pressures and their gap; where the approach is free, at the gap less its mean.

        What the pressures lack to the hardness, where there is one, is `room`.
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
        # Another approach puts no penetration right where some elements may penetrate.
        is_free = balanced and room is None
        error = max(high - lowest, tension) if is_free else max(misfit, violation)
        return cls(gap, r, mean, lowest, misfit, tension, violation, error)


class Change(NamedTuple):
    """A change of the pressures, that of the displacements, and what they lead to, on a part."""

    p: Array
    u: Array
    gap: Array  # The gap that it leads to, in some unit.
    is_solved: bool  # Whether it is solved as far as the set is worth it, and is no answer.
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
    """Solve on a set C of elements in contact as far as the set is worth it.

    Parameters
    ----------
    A, M : Products, Inverse
        Products with a matrix whose diagonal is 1, and an approximate inverse on the set.
    p, now : ndarray, Look
        The pressures to start from, and what is wrong with them.
    part : Part, Whole or None
        The elements that are looked at, to which the set belongs: what is returned is of these.
        All, where there is none.
    most : float
        The hardness, or infinity.
    eta, tolerance : float
        The misfit that may be left, relative to the violation of the set, and the error of
        complementarity below which no more is asked for.
    balanced : bool
        Whether the sum of the pressures is given, so that the change has the sum zero, and the
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
            break  # What is left is lost in the rounding.
        v = vectors.axpy(length, iteration.direction, v)
        Av = vectors.axpy(length, iteration.product, Av)
        count += 1
    dp, du = (elementwise(lambda x: vectors.cast(x, np.float64) * unit, x) for x in (v, Av))
    if balanced:
        dp = xp.where(C, dp - vectors.sum(dp) / area.size, dp)
    return Change(dp, du, look.gap, is_solved and not is_answer, count)
