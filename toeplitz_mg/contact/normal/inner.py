"""Conjugate gradients on a set of elements in contact, in single precision.

They find a change of the pressures, and that of the displacements, with the relative accuracy of
single precision: products take half the time. `active_set` adds the changes up in double
precision, and multiplies the sum anew before it believes an answer.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.products import Products
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.threads import elementwise
from toeplitz_mg.engine.vectors import Vectors

REDUCTION = 1e-5  # Reduction of the misfit for which single precision is good.
FAR = 1e30  # Size of a misfit, beyond which no sign changes: single precision ends at 1e38.
ANSWER = 0.9  # Part of the tolerance that is left to an answer in single precision.
SHARP = 0.1  # Part of the tolerance beyond which no set is solved more exactly.
LONG = 50  # Iterations after which the recurrence in single precision is not trusted.


class Area:
    """Elements in contact, with a mask to multiply by: that is faster than to index by them."""

    def __init__(self, C: Array, dtype: DTypeLike, vectors: Vectors) -> None:
        self.mask = elementwise(lambda C: C.astype(dtype), C)
        self.size = vectors.count(C)
        self.vectors = vectors

    def mean(self, x: Array) -> float:
        """Return the mean of a field in contact."""
        return self.vectors.dot(x, self.mask) / self.size


class Look(NamedTuple):
    """What is wrong with some pressures and a set of elements in contact."""

    gap: Array
    r: Array  # Minus the gap in contact, zero elsewhere.
    mean: float  # The mean that the gap had in contact, where the approach is free; else 0.
    lowest: float  # The smallest gap.
    misfit: float  # The largest size of the gap in contact.
    tension: float  # The largest negative pressure.
    violation: float  # How wrong the set is: the tension, or the depth of penetration elsewhere.
    error: float  # The error of complementarity, at an approach, if free, without penetration.

    @classmethod
    def at(cls, p: Array, gap: Array, area: Area, *, balanced: bool) -> Self:
        """Look at pressures and their gap; where the approach is free, at the gap less its mean."""
        mean = 0.0
        if balanced:
            mean = area.mean(gap)
            gap = elementwise(lambda g: g - mean, gap)
        r, vectors = (
            elementwise(lambda g, in_contact: -(g * in_contact), gap, area.mask),
            area.vectors,
        )
        low, high = -vectors.max(r), -vectors.min(r)
        least = vectors.min(elementwise(np.add, gap, r))
        lowest, tension = min(low, least), max(0.0, -vectors.min(p))
        misfit, violation = max(high, -low), max(tension, -least)
        error = max(high - lowest, tension) if balanced else max(misfit, violation)
        return cls(gap, r, mean, lowest, misfit, tension, violation, error)


class Change(NamedTuple):
    """A change of the pressures, that of the displacements, and what they lead to."""

    p: Array
    u: Array
    below: Array  # The elements in which the gap is negative.
    is_solved: bool  # Whether it is solved as far as the set is worth it, and is no answer.
    iterations: int


def solve_on_set(
    A: Products,
    M: Inverse,
    C: Array,
    p: Array,
    now: Look,
    *,
    eta: float,
    tolerance: float,
    balanced: bool,
) -> Change:
    """Solve on a set of elements in contact as far as the set is worth it.

    Parameters
    ----------
    A : Products
        Products with a matrix whose diagonal is 1.
    M : Inverse
        An approximate inverse on the set.
    C : ndarray of bool
        The set.
    p : ndarray
        The pressures to start from.
    now : Look
        What is wrong with them.
    eta : float
        The misfit that may be left, relative to the violation of the set.
    tolerance : float
        The error of complementarity below which no more is asked for.
    balanced : bool
        Whether the sum of the pressures is given, so that the change has the sum zero, and the
        approach is free.
    """
    vectors = A.vectors
    area = Area(C, M.dtype, vectors)
    unit = max(now.misfit, tolerance)

    def scale(x: Array) -> Array:
        scaled: Array = np.clip(x * (1.0 / unit), -FAR, FAR).astype(M.dtype)
        return scaled

    p0, gap0 = (elementwise(scale, x) for x in (p, now.gap))
    v, Av = (np.zeros(p.shape, M.dtype) for _ in range(2))

    def precondition(r: Array, out: Array) -> Array:
        y = M(r)
        mean = area.mean(y) if balanced else 0.0
        return elementwise(lambda y, in_contact: (y - mean) * in_contact, y, area.mask, out=out)

    def add(p: Array, gap: Array) -> tuple[Array, Array]:
        return elementwise(np.add, p, v), elementwise(np.add, gap, Av)

    iteration = ConjugateGradients(A, precondition, vectors)
    count = 0
    while True:
        look = Look.at(*add(p0, gap0), area, balanced=balanced)
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
    dp, du = (elementwise(lambda x: x.astype(np.float64) * unit, x) for x in (v, Av))
    if balanced:
        dp -= np.where(C, vectors.sum(dp) / area.size, 0.0)
    return Change(
        dp, du, elementwise(lambda g: g < 0.0, look.gap), is_solved and not is_answer, count
    )
