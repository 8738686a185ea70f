"""Integrals of a kernel over a rectangle at many points, by blocks and by distance."""

from collections.abc import Iterator
from math import frexp, hypot, prod

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import WORTH_THREADS, share
from toeplitz_mg.halfspace.integrals import (
    BLOCK,
    REACH,
    Kernel,
    choose,
    exact_integral,
    polynomials,
    sum_series,
)

SHARED = 2**17  # Points of a block shared by threads; with fewer they wait for the interpreter.
FARTHEST = 2.0**500  # Distance, in units, up to which squares do not overflow.
NEAR, BEYOND = -1, -2  # The rules besides the orders of a series.


def integrate(kernel: Kernel, x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return the integral of a kernel over the rectangle h1 × h2 about the origin.

    Parameters
    ----------
    kernel : dict
        The weights of its monomials, with x and y from the element of area to the point.
    x, y : ndarray
        The points; they broadcast.
    h1, h2 : float

    Returns
    -------
    ndarray of float64
        Accurate to rounding, relative to each integral; for x²/ρ³ alone, relative to that of 1/ρ.

    Notes
    -----
    The length of the series depends only on the distance of a point, not on the other points. So
    the integrals at mirrored points are bitwise equal, as a symmetric matrix requires. Points too
    near for any series, on most grids a few, are computed separately.
    """
    # Scaling by a power of two is exact, and avoids overflow of squares. The integral of a kernel
    # of degree -1 is proportional to the unit.
    unit = 2.0 ** (frexp(hypot(h1, h2))[1] - 1)
    kernel = {monomial: weight * unit for monomial, weight in kernel.items()}
    h1, h2 = h1 / unit, h2 / unit
    P = polynomials(kernel, h1, h2)
    reach = {order: (t * hypot(h1, h2) / 2.0) ** 2 for order, t in REACH.items()}
    begins = {NEAR: 0.0, **dict(sorted(reach.items(), reverse=True)), BEYOND: FARTHEST**2}

    near = exact_integral(kernel, h1, h2)

    def evaluate(rule: int, x: Array, y: Array, r2: Array) -> Array:
        if rule == NEAR:
            return near(*(np.broadcast_to(axis, r2.shape).ravel() for axis in (x, y))).reshape(
                r2.shape
            )
        if (
            rule == BEYOND
        ):  # A kernel of degree -1 is inversely proportional to a common factor of all lengths.
            x, y = x / FARTHEST, y / FARTHEST
            return _sum(kernel, P[:1], x, y, x * x + y * y) / FARTHEST
        return _sum(kernel, P[: rule + 1], x, y, r2)

    whole = np.broadcast_shapes(x.shape, y.shape)
    shape = whole or (1,)
    # Arrays are not repeated along axes on which they are constant.
    x, y = (np.reshape(axis, (1,) * (len(shape) - axis.ndim) + axis.shape) for axis in (x, y))
    integral = np.empty(shape)
    most = SHARED if integral.size >= WORTH_THREADS else BLOCK
    blocks = list(_blocks([slice(0, n) for n in shape], most))

    def work(numbers: range) -> None:
        for block in blocks[numbers.start : numbers.stop]:
            near_x, near_y = (_cut(axis, block) / unit for axis in (x, y))
            with np.errstate(over="ignore"):
                r2 = near_x * near_x + near_y * near_y
            integral[block] = choose(begins, r2, evaluate, near_x, near_y, r2)

    share(work, len(blocks), integral.size)
    return integral.reshape(whole)


def _sum(kernel: Kernel, P: list[list[float]], x: Array, y: Array, r2: Array) -> Array:
    """Return x^p y^q/ρ^(p+q+1) Σ_k ρ^(-2k) P_k(x²/ρ²) with p, q = 0 or 1."""
    e = np.divide(1.0, r2, out=r2)
    u = x * x * e
    value = sum_series(P, u, e)
    i, j, _ = next(iter(kernel))
    if i % 2:
        value *= x
    if j % 2:
        value *= y
    if i % 2 + j % 2 > 0:
        value *= e
    if i % 2 + j % 2 != 1:
        value *= np.sqrt(e, out=e)
    return value


def _cut(axis: Array, block: tuple[slice, ...]) -> Array:
    """Return a block of an array that may have length one along some axes."""
    return axis[
        tuple(part if n > 1 else slice(None) for n, part in zip(axis.shape, block, strict=True))
    ]


def _blocks(part: list[slice], most: int) -> Iterator[tuple[slice, ...]]:
    """Halve the longest axis of a part of an array until each part has at most `most` numbers."""
    lengths = [axis.stop - axis.start for axis in part]
    if prod(lengths) <= most:
        if prod(lengths) > 0:
            yield tuple(part)
        return
    k = int(np.argmax(lengths))
    middle = part[k].start + lengths[k] // 2
    for half in (slice(part[k].start, middle), slice(middle, part[k].stop)):
        yield from _blocks([*part[:k], half, *part[k + 1 :]], most)
