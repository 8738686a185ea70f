"""Integrals of the half-space's kernels over a rectangle and of the logarithm over an interval.

All are exact to rounding, relative to the integral itself, at any point and for any shape of
rectangle. A closed form is a difference over the corners, which loses digits as
(distance/size)^2. So it serves near the rectangle only. Elsewhere integrals along the rectangle,
which are written without a cancellation, are integrated over its width: in the direction in which
it is the narrower for its distance.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.expansion import Kernel, choose
from toeplitz_mg.halfspace.narrow import BEGINS, NEAR, LineIntegral, gauss

# From the first k on, the k-th ∫ ln|s| is ln k - Σ 1/(2j (2j+1) (2k)^2j) with so many terms: the
# next is 1e-20.
LOG_SERIES = (16, 5)
LOG_GAUSS = (2, 10)  # The first k of Gauss's rule, and its nodes.
BLOCK = 2**14  # Points of a block: of fewer, threads wait for the interpreter between passes.

ONE, XX, XY, X = (0, 0, 1), (2, 0, 3), (1, 1, 3), (1, 0, 2)  # 1/ρ, x²/ρ³, x y/ρ³ and x/ρ².


def exact_integral(kernel: Kernel, h1: float, h2: float) -> Callable[[Array, Array], Array]:
    """Return the integral of a kernel over the rectangle h1 × h2 about the origin, as a function.

    Its arguments `x` and `y`, of shape (points,), go from the rectangle's centre to the points, and
    x and y in the kernel's monomials from an element of area; `ONE` and `XX` may be together.
    """
    if XY in kernel:
        return lambda x, y: kernel[XY] * _integral_xy(x, y, h1, h2)
    lines, over_corners = _closed(kernel)

    def evaluate(in_x: int, x: Array, y: Array, middle: Array, width: Array) -> Array:
        t, s, width, length = (middle, y, width, h2) if in_x else (y, x, np.full_like(y, h2), h1)

        def serve(rule: int, x: Array, y: Array, t: Array, s: Array, width: Array) -> Array:
            if rule == NEAR:
                return over_corners(x, y, h1, h2)
            return lines[in_x].over_width(rule, t, s, width, length)

        with np.errstate(divide="ignore"):  # Of no width the integral is zero.
            distance = t / width
        return choose(BEGINS, distance, serve, x, y, t, s, width)

    def integral(x: Array, y: Array) -> Array:
        # It is even or odd in x and in y, to the last bit.
        sign, x, y = np.sign(x), np.abs(x), np.abs(y)
        if X in kernel:
            # What the rectangle has behind a point inside cancels as much of it ahead, and is left
            # out. The rest has one sign. This is its width, and the distance of its middle.
            width, middle = np.minimum(2.0 * x, h1), np.maximum(x, h1 / 2.0)
        else:
            width, middle = np.full_like(x, h1), x
        # Products are compared, as the width is zero on the axis.
        in_x = middle * h2 >= y * width
        value = choose({0: 0.0, 1: 1.0}, in_x, evaluate, x, y, middle, width)
        return sign * value if X in kernel else value

    return integral


def _closed(kernel: Kernel) -> tuple[tuple[LineIntegral, LineIntegral], Callable[..., Array]]:
    """Return a kernel's integrals along x and along y, and over the corners."""
    if X in kernel:
        lines = LineIntegral.half_logarithm(kernel[X]), LineIntegral.angle(kernel[X])
        return lines, partial(_x_over_corners, lines)
    one, xx = kernel.get(ONE, 0.0), kernel.get(XX, 0.0)
    # Along x, x²/ρ³ is 1/ρ - y²/ρ³.
    lines = LineIntegral.inverse(one + xx, -xx), LineIntegral.inverse(one, xx)
    return lines, partial(_over_corners, one, xx)


def _integral_xy(x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ x y/ρ³."""
    X, Y = ([a * a for a in _sides(*side)] for side in ((x, h1), (y, h2)))
    # It is -[[ρ]] over the corners, each difference by a - b = (a² - b²)/(a + b): exact everywhere.
    r11, r12, r21, r22 = (np.sqrt(a + b) for a in X for b in Y)
    sums = 1.0 / (r11 + r12) + 1.0 / (r21 + r22)
    return 4.0 * x * h1 * y * h2 * sums / ((r11 + r21) * (r12 + r22))


def integral_log(n: int) -> Array:
    """Return ∫ ln|s| ds from k - ½ to k + ½, for k = 0 ... n - 1."""
    integral = np.empty(n)
    k = np.arange(min(n, LOG_SERIES[0]), dtype=np.float64)
    right, left = k + 0.5, np.abs(k - 0.5)
    near = right * np.log(right) - (k - 0.5) * np.log(left) - 1.0
    t, nodes = LOG_GAUSS
    near[k >= t] = sum(w * np.log(k[k >= t] + s) for s, w in gauss(nodes))
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


def _over_corners(one: float, xx: float, x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ one/ρ + xx x²/ρ³ as differences over the corners.

    Those of x²/ρ³ and y²/ρ³ are [[Y asinh(X/|Y|)]] and [[X asinh(Y/|X|)]], of 1/ρ their sum.
    """

    def term(a: Array, b: Array) -> Array:
        safe = np.where(a == 0.0, 1.0, np.abs(a))
        return a * np.arcsinh(b / safe)  # This is 0 where a is 0.

    (X1, X2), (Y1, Y2) = _sides(x, h1), _sides(y, h2)
    of_xx = term(Y2, X2) - term(Y2, X1) - term(Y1, X2) + term(Y1, X1)
    of_yy = term(X2, Y2) - term(X2, Y1) - term(X1, Y2) + term(X1, Y1)
    return one * (of_xx + of_yy) + xx * of_xx


def _x_over_corners(
    lines: tuple[LineIntegral, LineIntegral], x: Array, y: Array, h1: float, h2: float
) -> Array:
    """Return ∬ x/ρ² = [[½ Y ln(X² + Y²) + X arctan(Y/X)]] for x, y ≥ 0, by those along sides."""
    along_x, along_y = lines

    def logarithm(Y: Array) -> Array:
        # At a corner it is infinite, and its product with Y = 0 is zero.
        return Y * along_x.at(np.where(Y == 0.0, h1, Y), x, h1)

    X1, X2 = np.abs(x - h1 / 2.0), x + h1 / 2.0  # The ends of the part that has one sign.
    Y1, Y2 = _sides(y, h2)
    # So near, what is subtracted is not large beside the integral, whatever the shape.
    angles = X2 * along_y.at(X2, y, h2) - X1 * along_y.at(X1, y, h2)
    return logarithm(Y2) - logarithm(Y1) + angles


def _sides(x: Array, h: float) -> tuple[Array, Array]:
    return x - h / 2.0, x + h / 2.0
