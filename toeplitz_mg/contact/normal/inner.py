"""Conjugate gradients on a set of elements in contact, in single precision.

They find a change of the pressures, and that of the displacements, with the relative accuracy of
single precision: products take half the time. `active_set` adds the changes up in double
precision, and multiplies the sum anew before it believes an answer.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import Products, dot
from toeplitz_mg.contact.inverse import Inverse

REDUCTION = 1e-5  # of the misfit, for which single precision is good
FAR = 1e30  # misfits, beyond which no sign changes: single precision ends at 1e38
LONG = 50  # iterations, after which no recurrence is trusted


class Area:
    """Elements in contact, with a mask to multiply by: that is faster than to index by them."""

    def __init__(self, C: Array, dtype: DTypeLike) -> None:
        self.mask = C.astype(dtype)
        self.size = int(np.count_nonzero(C))

    def mean(self, x: Array) -> float:
        """The mean of a field in contact."""
        return dot(x, self.mask) / self.size


class Look(NamedTuple):
    """What is wrong with some pressures and a set of elements in contact."""

    gap: Array
    r: Array  # minus the gap, in contact
    mean: float  # what the gap was in contact, on average, if the approach is free
    lowest: float  # gap
    misfit: float  # the largest gap in contact
    tension: float  # the largest negative pressure
    violation: float  # of the set: that, and penetration elsewhere
    error: float  # of complementarity, with the approach at which nothing penetrates, if it is free

    @classmethod
    def at(cls, p: Array, gap: Array, area: Area, *, balanced: bool) -> Self:
        """Look at pressures and their gap; where the approach is free, at that less its mean."""
        mean = 0.0
        if balanced:
            mean = area.mean(gap)
            gap -= mean
        r = gap * area.mask
        low, high = float(r.min()), float(r.max())
        least = float((gap - r).min())
        lowest, tension = min(low, least), max(0.0, -float(p.min()))
        misfit, violation = max(high, -low), max(tension, -least)
        error = max(high - lowest, tension) if balanced else max(misfit, violation)
        return cls(gap, np.negative(r, out=r), mean, lowest, misfit, tension, violation, error)


class Change(NamedTuple):
    """Of pressures and their displacements, and what it leads to."""

    p: Array
    u: Array
    below: Array  # the elements of a negative gap
    is_solved: bool  # as far as the set is worth it
    iterations: int


def conjugate_gradients(
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
    """Solve on a set as far as it is worth, with changes of the sum zero where `balanced`.

    Parameters
    ----------
    A : Products
        With a matrix whose diagonal is 1.
    M : Inverse
    C : ndarray of bool
    p : ndarray
        Pressures.
    now : Look
        At them.
    eta : float
        What of the violation of the set may be left as misfit.
    tolerance : float
        Of the complementarity. No more is asked for.
    balanced : bool
        Whether the sum of the pressures is given, and the approach is free.
    """
    area = Area(C, M.dtype)
    unit = max(now.misfit, tolerance)
    p0, gap0 = (np.clip(x * (1.0 / unit), -FAR, FAR).astype(M.dtype) for x in (p, now.gap))
    v, Av, d = (np.zeros_like(p0) for _ in range(3))
    rho, count = 0.0, 0
    while True:
        look = Look.at(p0 + v, gap0 + Av, area, balanced=balanced)
        is_answer = look.tension == 0.0 and look.error <= 0.9 * tolerance / unit
        is_solved = look.misfit <= max(eta * look.violation, 0.1 * tolerance / unit)
        if is_answer or is_solved or look.misfit <= REDUCTION or count == LONG or A.exhausted:
            break
        y = M(look.r)
        if balanced:
            y -= area.mean(y)
        y *= area.mask
        rho, before = dot(look.r, y), rho
        d *= rho / before if count else 0.0
        d += y
        Ad = A(d)
        step = rho / dot(d, Ad)
        v += np.multiply(d, step, out=y)
        Av += np.multiply(Ad, step, out=y)
        count += 1
    dp, du = (x.astype(np.float64) * unit for x in (v, Av))
    if balanced:
        dp -= dp.sum() / area.size * area.mask
    return Change(dp, du, look.gap < 0.0, is_solved and not is_answer, count)
