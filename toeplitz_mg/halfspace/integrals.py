"""Integrals of the half-space's kernels over a rectangle and of the logarithm over an interval.

All are exact to rounding, relative to the integral itself, at any point and for any shape of
rectangle. A closed form is a difference over the corners, which loses digits as
(distance/size)^2. So it serves near the rectangle only. Elsewhere Gauss's rule is taken in the
direction in which the rectangle is the smaller for its distance, where it is as good as exact,
over integrals in the other direction that are written without a cancellation.
"""

from functools import cache

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.expansion import Kernel

# Pairs of a distance t, in sizes of the rectangle, and the nodes of Gauss's rule from there on: the
# integrand is analytic in an ellipse whose half axes add up to ϱ = 2 t + √(4 t² - 1) half sizes,
# and the rule errs by ϱ^(-2 nodes).
GAUSS = ((2.0, 10), (16.0, 5), (100.0, 3), (2500.0, 2))

# From the first k on, the k-th ∫ ln|s| is ln k - Σ 1/(2j (2j+1) (2k)^2j) with so many terms: the
# next is 1e-20.
LOG_SERIES = (16, 5)
BLOCK = 2**13  # Points of a block, whose dozen of passes then stay in the cache.

ONE, XX, XY, X = (0, 0, 1), (2, 0, 3), (1, 1, 3), (1, 0, 2)  # 1/ρ, x²/ρ³, x y/ρ³ and x/ρ².


def integrate_exactly(kernel: Kernel, x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return the integral of a kernel over the rectangle h1 × h2 about the origin.

    `x` and `y`, of shape (points,), go from the rectangle's centre to the points, and x and y in
    the kernel's monomials from an element of area; `ONE` and `XX` may be together.
    """
    if XY in kernel:
        return kernel[XY] * _integral_xy(x, y, h1, h2)
    if X in kernel:
        return kernel[X] * _integral_x(x, y, h1, h2)
    one, xx = _integrals(x, y, h1, h2)
    return kernel.get(ONE, 0.0) * one + kernel.get(XX, 0.0) * xx


def _integrals(x: Array, y: Array, h1: float, h2: float) -> tuple[Array, Array]:
    """Return ∬ 1/ρ and ∬ x²/ρ³."""
    # The integrals are even in x and in y, to the last bit.
    x, y = np.abs(x), np.abs(y)
    t1, t2 = x / h1, y / h2
    one, xx = np.empty_like(x), np.empty_like(x)
    near = np.maximum(t1, t2) < GAUSS[0][0]
    one[near], xx[near] = _over_corners(x[near], y[near], h1, h2)
    ends = [t for t, _ in GAUSS[1:]] + [np.inf]
    for (start, nodes), end in zip(GAUSS, ends, strict=True):
        far = (t1 >= t2) & (start <= t1) & (t1 < end)
        one[far], xx[far], _ = _gauss_in_x(x[far], y[far], h1, h2, nodes)
        far = (t2 > t1) & (start <= t2) & (t2 < end)
        one[far], _, xx[far] = _gauss_in_x(y[far], x[far], h2, h1, nodes)
    return one, xx


def _integral_xy(x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ x y/ρ³."""
    (X1, X2), (Y1, Y2) = _sides(x, h1), _sides(y, h2)
    # It is -[[ρ]] over the corners, each difference by a - b = (a² - b²)/(a + b): exact everywhere.
    r11, r12, r21, r22 = np.hypot(X1, Y1), np.hypot(X1, Y2), np.hypot(X2, Y1), np.hypot(X2, Y2)
    sums = 1.0 / (r11 + r12) + 1.0 / (r21 + r22)
    return 4.0 * x * h1 * y * h2 * sums / ((r11 + r21) * (r12 + r22))


def _integral_x(x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ x/ρ²."""
    sign, x, y = np.sign(x), np.abs(x), np.abs(y)
    # What the rectangle has behind a point inside cancels as much of it ahead, and is left out.
    # The rest has one sign. This is its width, and the distance of its middle.
    width, middle = np.minimum(2.0 * x, h1), np.maximum(x, h1 / 2.0)
    # Products are compared, as the width is zero on the axis, where the integral is zero too.
    in_x = middle * h2 >= y * width
    size, distance = np.where(in_x, width, h2), np.where(in_x, middle, y)
    passed = np.sum([distance >= t * size for t, _ in GAUSS], axis=0)
    integral = np.empty_like(x)
    near = passed == 0
    integral[near] = _x_over_corners(x[near], y[near], h1, h2)
    for k, (_, nodes) in enumerate(GAUSS, start=1):
        far = (passed == k) & in_x
        X, h, Y = middle[far], width[far], y[far]
        integral[far] = h * sum(w * _x_along_y(X + s * h, Y, h2) for s, w in _gauss(nodes))
        far = (passed == k) & ~in_x
        X, Y = x[far], y[far]
        integral[far] = h2 * sum(w * _x_along_x(X, Y + s * h2, h1) for s, w in _gauss(nodes))
    return sign * integral


def integral_log(n: int) -> Array:
    """Return ∫ ln|s| ds from k - ½ to k + ½, for k = 0 ... n - 1."""
    integral = np.empty(n)
    k = np.arange(min(n, LOG_SERIES[0]), dtype=np.float64)
    right, left = k + 0.5, np.abs(k - 0.5)
    near = right * np.log(right) - (k - 0.5) * np.log(left) - 1.0
    t, nodes = GAUSS[0]
    near[k >= t] = sum(w * np.log(k[k >= t] + s) for s, w in _gauss(nodes))
    integral[: len(k)] = near
    for start in range(len(k), n, BLOCK):
        k = np.arange(start, min(start + BLOCK, n), dtype=np.float64)
        part = integral[start : start + BLOCK]
        e, rest = 1.0 / (k * k), np.zeros_like(k)
        for j in range(LOG_SERIES[1], 0, -1):
            rest += 1.0 / (2 * j * (2 * j + 1) * 4**j)
            rest *= e
        np.log(k, out=part)
        part -= rest
    return integral


def _over_corners(x: Array, y: Array, h1: float, h2: float) -> tuple[Array, Array]:
    """Return, as differences over the corners, ∬ 1/ρ and ∬ x²/ρ³.

    The latter and ∬ y²/ρ³ are [[Y asinh(X/|Y|)]] and [[X asinh(Y/|X|)]], the former is their sum.
    """

    def term(a: Array, b: Array) -> Array:
        safe = np.where(a == 0.0, 1.0, np.abs(a))
        return a * np.arcsinh(b / safe)  # This is 0 where a is 0.

    (X1, X2), (Y1, Y2) = _sides(x, h1), _sides(y, h2)
    xx = term(Y2, X2) - term(Y2, X1) - term(Y1, X2) + term(Y1, X1)
    yy = term(X2, Y2) - term(X2, Y1) - term(X1, Y2) + term(X1, Y1)
    return xx + yy, xx


def _gauss_in_x(x: Array, y: Array, h1: float, h2: float, nodes: int) -> tuple[Array, Array, Array]:
    """Return ∬ 1/ρ, ∬ x²/ρ³ and ∬ y²/ρ³ by Gauss's rule over x, for |x| well above h1."""
    one, xx = np.zeros_like(x), np.zeros_like(x)
    low, high = _sides(np.abs(y), h2)
    beside = low > 0.0
    for points, along_y in ((beside, _beside), (~beside, _across)):
        if points.any():
            X, Y1, Y2 = x[points], low[points], high[points]
            for s, w in _gauss(nodes):
                inner_one, inner_xx = along_y(np.abs(X + s * h1), Y1, Y2, h2)
                one[points] += w * h1 * inner_one
                xx[points] += w * h1 * inner_xx
    # Where the difference cancels, ∬ y²/ρ³ is small beside the ∬ 1/ρ that it is added to.
    return one, xx, one - xx


def _across(X: Array, low: Array, high: Array, _: float) -> tuple[Array, Array]:
    """Return ∫ dy/ρ and ∫ x²/ρ³ dy from low ≤ 0 to high > 0 at the distance X > 0."""
    one, xx = np.zeros_like(X), np.zeros_like(X)
    for Y in (high, -low):
        r = np.sqrt(X * X + Y * Y)
        ratio = Y / X
        ratio += ratio * Y / (X + r)
        one += np.log1p(ratio)  # This is asinh(Y/X).
        xx += Y / r
    return one, xx


def _beside(X: Array, low: Array, high: Array, h: float) -> tuple[Array, Array]:
    """Return ∫ dy/ρ and ∫ x²/ρ³ dy from low > 0 to high = low + h, without a cancellation."""
    r1, r2 = np.hypot(X, low), np.hypot(X, high)
    rise = h * (low + high)  # This is r2² - r1².
    one = np.log1p((h + rise / (r1 + r2)) / (low + r1))
    return one, X**2 * rise / ((high * r1 + low * r2) * r1 * r2)


def _x_over_corners(x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ x/ρ² = [[½ Y ln(X² + Y²) + X arctan(Y/X)]] for x, y ≥ 0, by the integrals below."""
    X1, X2 = np.abs(x - h1 / 2.0), x + h1 / 2.0  # The ends of the part that has one sign.
    Y1, Y2 = _sides(y, h2)
    # So near, what is subtracted is not large beside the integral, whatever the shape.
    in_y = Y2 * _x_along_x(x, Y2, h1) - Y1 * _x_along_x(x, Y1, h1)
    in_x = X2 * _x_along_y(X2, y, h2) - X1 * _x_along_y(X1, y, h2)
    return in_y + in_x


def _x_along_x(x: Array, Y: Array, h: float) -> Array:
    """Return ∫ X/ρ² dX over the length h about x ≥ 0: half the logarithm of a quotient."""
    r2 = (x - h / 2.0) ** 2 + Y**2
    return 0.5 * np.log1p(2.0 * x * h / np.where(r2 == 0.0, 1.0, r2))


def _x_along_y(X: Array, y: Array, h: float) -> Array:
    """Return ∫ X/ρ² dY over the length h about y, seen at an angle from the distance X ≥ 0."""
    low, high = _sides(y, h)
    # Where the sum cancels, it is small beside h X: the angle is close to a right one.
    return np.arctan2(h * X, X**2 + low * high)


def _sides(x: Array, h: float) -> tuple[Array, Array]:
    return x - h / 2.0, x + h / 2.0


@cache
def _gauss(nodes: int) -> list[tuple[float, float]]:
    """Return the nodes and the weights of Gauss and Legendre's rule on [-½, ½]."""
    s, w = np.polynomial.legendre.leggauss(nodes) / np.array(2.0)
    return list(zip(s.tolist(), w.tolist(), strict=True))
