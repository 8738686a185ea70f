"""Integrals of the half-space's kernels over a rectangle and of the logarithm over an interval.

All are accurate to rounding, relative to the integral, at any point and for any shape of the
rectangle. A closed form is a difference over the corners and loses digits like (distance/size)². So
it is used only near the rectangle.

Far away the integral is a series in (size of the rectangle/distance)². The Taylor series about the
centre gives ∬ f = h₁ h₂ Σ_k Σ_{a+b=k} (h₁/2)^2a (h₂/2)^2b /((2a+1)! (2b+1)!) ∂_x^2a ∂_y^2b f. A
kernel is a sum of monomials x^i y^j/ρ^m of degree -1. After a factor x^p y^q (p, q = 0 or 1) and a
power of ρ, each derivative is a polynomial in u = x²/ρ²:

    ∬ f = x^p y^q/ρ^(p+q+1) Σ_k ρ^(-2k) P_k(u).

So a value takes one division, at most one root, and a few products, without cancellation. At medium
distances the kernel is integrated in closed form along the rectangle, written without cancellation,
and numerically over its width; the width is the side that is smaller relative to its distance. Let
t be the distance from a line, s the coordinate along it, ρ² = t² + s², and F(t) the integral along
the length. Then ∬ f = h Σ_k (h/2)^2k/(2k+1)! F^(2k)(t) for the width h. At each end of the length
the derivatives are w P(u)/t^m, with a polynomial of u = s²/ρ² and a factor w = s^i t^j/ρ^(i+j). At
shorter distances Gauss's rule replaces the series.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from math import comb, factorial
from typing import Self

import numpy as np

from toeplitz_mg._typing import Array

Monomial = tuple[int, int, int]  # (i, j, m) stands for x^i y^j/ρ^m, with i + j - m = -1.
Kernel = dict[Monomial, float]  # Monomials of the same parities, and their weights.

ONE, XX, XY, X = (0, 0, 1), (2, 0, 3), (1, 1, 3), (1, 0, 2)  # 1/ρ, x²/ρ³, x y/ρ³ and x/ρ².

BLOCK = 2**14  # Points of a block; with fewer, threads wait for the interpreter between passes.
# From the first number on, the k-th ∫ ln|s| is ln k - Σ 1/(2j (2j+1) (2k)^2j) with the second
# number of terms; the next term is 1e-20.
LOG_SERIES = (16, 5)
LOG_GAUSS = (2, 10)  # The first k for which Gauss's rule is used, and its number of nodes.

# From afar ----------------------------------------------------------------------------------------

HIGHEST = 9  # Order of the longest series, used from 7.7 half diagonals on (the next: 6.7).


def _reach(order: int) -> float:
    """Return the distance, in half diagonals, from which a series up to this order is exact.

    The monomials are at most second derivatives of harmonic functions. So, in units of the half
    diagonal, the first neglected term is at most (2k)² moments/ρ^2k. The moments of order 2k are
    largest for a rectangle that is a line, 1/(2k + 1).
    """
    k = order + 1
    return float(((2 * k + 1) * 2.0**53) ** (0.5 / k))


REACH = {order: _reach(order) for order in range(2, HIGHEST + 1)}


def polynomials(kernel: Kernel, h1: float, h2: float) -> list[list[float]]:
    """Return the coefficients of all P_k for the rectangle h1 × h2."""
    k, a = np.indices((HIGHEST + 1, HIGHEST + 1))
    b = np.maximum(k - a, 0)
    sizes = h1 * h2 * h1 ** (2.0 * a) * h2 ** (2.0 * b)
    P = sum(
        weight * np.einsum("ka,kau->ku", sizes, _derivatives(monomial))
        for monomial, weight in kernel.items()
    )
    return [np.trim_zeros(p, "b").tolist() or [0.0] for p in P]


def choose(
    begins: Mapping[int, float],
    distance: Array,
    evaluate: Callable[..., Array],
    *points: Array,
) -> Array:
    """Return values at points; each uses the last rule that starts below its distance.

    Parameters
    ----------
    begins : mapping
        The distance from which each rule is used, ascending; the first is used from zero on.
    distance : ndarray
        The distances of the points.
    evaluate : function
        ``evaluate(rule, *points)`` for the points of a rule: arrays of shape (points,), or all
        points in their own shape.
    points : ndarray
        Arrays that broadcast to the shape of the distances.
    """
    if distance.size == 0:
        return np.empty(distance.shape)
    rules, starts = list(begins), np.array(list(begins.values()))
    ends = distance.min(), distance.max()
    first, last = np.maximum(np.searchsorted(starts, ends, side="right") - 1, 0)
    if first == last:
        return evaluate(rules[first], *points)
    value = np.empty(distance.shape)
    points = tuple(np.broadcast_to(array, distance.shape) for array in points)
    for k in range(first, last + 1):
        part = distance < starts[k + 1] if k < last else np.ones(distance.shape, bool)
        if k > first:
            part &= distance >= starts[k]
        if part.any():
            value[part] = evaluate(rules[k], *(array[part] for array in points))
    return value


def sum_series(P: list[list[float]], u: Array, e: Array | float) -> Array:
    """Return Σ_k e^k P_k(u)."""
    total = _evaluate(P[-1], u, np.empty_like(u))
    term = np.empty_like(u)
    for p in reversed(P[:-1]):
        total *= e
        total += _evaluate(p, u, term) if len(p) > 1 else p[0]
    return total


def _evaluate(p: list[float], u: Array, out: Array) -> Array:
    """Evaluate a polynomial by Horner's rule."""
    if len(p) == 1:
        out[...] = p[0]
        return out
    np.multiply(u, p[-1], out=out)
    for c in p[-2:0:-1]:
        out += c
        out *= u
    out += p[0]
    return out


@cache
def _derivatives(monomial: Monomial) -> Array:
    """Return the ∂_x^2a ∂_y^2b of a monomial divided by 2^2k (2a+1)! (2b+1)!, b = k - a.

    The shape is (orders k, a, powers of u); entries with a > k are zero.
    """
    result = np.zeros((HIGHEST + 1, HIGHEST + 1, HIGHEST + 2))
    for k in range(HIGHEST + 1):
        for a in range(k + 1):
            b = k - a
            p = [0] * (HIGHEST + 2)
            for (i, j, _), c in _derivative(monomial, 2 * a, 2 * b).items():
                # x^i y^j = x^(i % 2) y^(j % 2) u^(i // 2) (1 - u)^(j // 2), times a power of ρ.
                for power in range(j // 2 + 1):
                    p[i // 2 + power] += c * comb(j // 2, power) * (-1) ** power
            below = 4**k * factorial(2 * a + 1) * factorial(2 * b + 1)
            result[k, a] = [c / below for c in p]
    return result


@cache
def _derivative(monomial: Monomial, in_x: int, in_y: int) -> dict[Monomial, int]:
    """Return the monomials of a derivative with their coefficients."""
    if in_x == in_y == 0:
        return {monomial: 1}
    di, dj = (1, 0) if in_x else (0, 1)
    derivative: defaultdict[Monomial, int] = defaultdict(int)
    for (i, j, m), c in _derivative(monomial, in_x - di, in_y - dj).items():
        derivative[i + di, j + dj, m + 2] -= c * m
        if power := di * i + dj * j:
            derivative[i - di, j - dj, m] += c * power
    return derivative


# Along the rectangle ------------------------------------------------------------------------------

# At a distance of t widths or more the integrand is analytic in an ellipse whose half axes sum to
# ϱ = 2 t + √(4 t² - 1) half widths; the error of Gauss's rule is ϱ^(-2 nodes).
NEAREST, NODES = 2.0, 10
HIGHEST_ALONG = 4  # Order of the longest series, used from 16.6 widths on; below is Gauss's rule.
NEAR, BY_GAUSS = -2, -1  # The other rules: the closed form, and Gauss's rule.


def _begin_along(order: int) -> float:
    """Return the distance, in widths, from which a series up to this order is exact.

    F is analytic at distances below t, so by Cauchy's estimate the first neglected term is at most
    1/((2k + 1) (2t)^2k).
    """
    k = order + 1
    return float(0.5 * (2.0**54 / (2 * k + 1)) ** (0.5 / k))


BEGINS = {
    NEAR: 0.0,
    BY_GAUSS: NEAREST,
    **{order: _begin_along(order) for order in range(HIGHEST_ALONG, -1, -1)},
}


@dataclass(frozen=True)
class LineIntegral:
    """∫ f ds for a kernel f along a length: α closed + β w, evaluated at the ends.

    Attributes
    ----------
    alpha, beta : float
    closed : function
        A function of t, s in the middle, the length, and s and ρ at both ends. Its derivative by t
        is w P(u)/t at the ends, with the polynomial `slope`.
    powers : (int, int)
        i and j in w = s^i t^j/ρ^(i+j).
    slope : tuple of float
    """

    alpha: float
    beta: float
    closed: Callable[..., Array]
    powers: tuple[int, int]
    slope: tuple[float, ...]

    @classmethod
    def inverse(cls, a: float, b: float) -> Self:
        """Return the integral along s of a/ρ + b t²/ρ³."""
        return cls(a, b, _logarithm, (1, 0), (-1.0,))

    @classmethod
    def angle(cls, weight: float) -> Self:
        """Return the integral along s of t/ρ²."""
        return cls(weight, 0.0, _angle, (1, 1), (-1.0,))

    @classmethod
    def half_logarithm(cls, weight: float) -> Self:
        """Return the integral along s of s/ρ²."""
        return cls(weight, 0.0, _half_logarithm, (0, 0), (1.0, -1.0))

    def at(self, t: Array, s: Array, length: float) -> Array:
        """Return α closed for the line at the distance t."""
        return self._evaluate([], t, s, length)

    def over_width(self, rule: int, t: Array, s: Array, width: Array, length: float) -> Array:
        """Return the integral over a width, by any rule except `NEAR`."""
        P = _polynomials_along(self)
        if rule == BY_GAUSS:
            value = np.zeros_like(t)
            for node, weight in gauss(NODES):
                value += weight * self._evaluate(P[:1], t + node * width, s, length)
        else:
            e = 0.5 * width / t
            e *= e
            value = self._evaluate(P[: rule + 1], t, s, length, e)
        value *= width
        return value

    def _evaluate(
        self, P: list[list[float]], t: Array, s: Array, length: float, e: Array | float = 0.0
    ) -> Array:
        """Return α closed + w Σ_k e^k P_k(u), evaluated at the ends."""
        low, high = s - 0.5 * length, s + 0.5 * length
        t2 = t * t
        r1, r2 = np.sqrt(t2 + low * low), np.sqrt(t2 + high * high)
        value = self.closed(t, s, length, low, high, r1, r2)
        value *= self.alpha
        if any(any(p) for p in P):
            value += self._at_end(P, t, high, r2, e)
            value -= self._at_end(P, t, low, r1, e)
        return value

    def _at_end(
        self, P: list[list[float]], t: Array, s: Array, r: Array, e: Array | float
    ) -> Array:
        c = s / r
        value = sum_series(P, c * c, e)
        for factor, power in zip((c, t / r if self.powers[1] else 1.0), self.powers, strict=True):
            if power:
                value *= factor
        return value


@lru_cache(maxsize=64)
def _polynomials_along(line: LineIntegral) -> list[list[float]]:
    """Return P_2k(u)/(2k+1)! for all orders k."""
    own = _derivatives_along(line.powers, (1.0,), 0)
    closed = [np.zeros(1), *_derivatives_along(line.powers, line.slope, 1)]
    P = [
        np.polynomial.polynomial.polyadd(line.alpha * closed[2 * k], line.beta * own[2 * k])
        / factorial(2 * k + 1)
        for k in range(HIGHEST_ALONG + 1)
    ]
    return [p.tolist() for p in P]


@cache
def _derivatives_along(powers: tuple[int, int], first: tuple[float, ...], m: int) -> list[Array]:
    """Return P_m, P_m+1, … in the derivatives w P_m(u)/t^m, given the first."""
    i, j = powers
    u, P = np.polynomial.Polynomial([0.0, 1.0]), np.polynomial.Polynomial(first)
    found = [P]
    for order in range(m, 2 * HIGHEST_ALONG):
        # w' = w (j - (i + j)(1 - u))/t, and u' = -2 u (1 - u)/t.
        P = (j - (i + j) * (1.0 - u) - order) * P - 2.0 * u * (1.0 - u) * P.deriv()
        found.append(P)
    return [p.coef for p in found]


def _logarithm(
    t: Array, s: Array, length: float, low: Array, high: Array, r1: Array, r2: Array
) -> Array:
    """Return ∫ ds/ρ = ln (r1 + r2 + length)/(r1 + r2 - length)."""
    # The denominator is (r1 + low) + (r2 - high), each written without cancellation.
    t2 = t * t
    before = r1 + np.abs(low)
    before = np.where(low > 0.0, before, t2 / before)
    before += t2 / (r2 + high)
    value: Array = np.log1p(2.0 * length / before)
    return value


def _angle(
    t: Array, s: Array, length: float, low: Array, high: Array, r1: Array, r2: Array
) -> Array:
    """Return ∫ t/ρ² ds, the angle at which the length is seen."""
    # If the sum cancels it is small compared to the product: the angle is near a right angle.
    value: Array = np.arctan2(length * t, t * t + low * high)
    return value


def _half_logarithm(
    t: Array, s: Array, length: float, low: Array, high: Array, r1: Array, r2: Array
) -> Array:
    """Return ∫ s/ρ² ds = ln r2/r1."""
    return 0.5 * np.log1p(2.0 * length * s / (r1 * r1))


@cache
def gauss(nodes: int) -> list[tuple[float, float]]:
    """Return the nodes and weights of the Gauss-Legendre rule on [-½, ½]."""
    s, w = np.polynomial.legendre.leggauss(nodes) / np.array(2.0)
    return list(zip(s.tolist(), w.tolist(), strict=True))


# All distances ------------------------------------------------------------------------------------


def exact_integral(kernel: Kernel, h1: float, h2: float) -> Callable[[Array, Array], Array]:
    """Return a function for the integral of a kernel over the rectangle h1 × h2 about the origin.

    Its arguments `x` and `y`, of shape (points,), are the points relative to the rectangle's
    centre. In the monomials x and y are relative to an element of area. `ONE` and `XX` may be
    combined.
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

        with np.errstate(divide="ignore"):  # The integral over a width of zero is zero.
            distance = t / width
        return choose(BEGINS, distance, serve, x, y, t, s, width)

    def integral(x: Array, y: Array) -> Array:
        # The integral is exactly even or odd in x and in y.
        sign, x, y = np.sign(x), np.abs(x), np.abs(y)
        if X in kernel:
            # For a point inside, the parts of the rectangle before and behind it cancel, and only
            # the rest is integrated, with one sign. This is its width, and its distance.
            width, middle = np.minimum(2.0 * x, h1), np.maximum(x, h1 / 2.0)
        else:
            width, middle = np.full_like(x, h1), x
        # Compare products, because the width is zero on the axis.
        in_x = middle * h2 >= y * width
        value = choose({0: 0.0, 1: 1.0}, in_x, evaluate, x, y, middle, width)
        return sign * value if X in kernel else value

    return integral


def _closed(kernel: Kernel) -> tuple[tuple[LineIntegral, LineIntegral], Callable[..., Array]]:
    """Return the integrals of a kernel along x and along y, and in closed form over the corners."""
    if X in kernel:
        lines = LineIntegral.half_logarithm(kernel[X]), LineIntegral.angle(kernel[X])
        return lines, partial(_x_over_corners, lines)
    one, xx = kernel.get(ONE, 0.0), kernel.get(XX, 0.0)
    # For the integral along x: x²/ρ³ = 1/ρ - y²/ρ³.
    lines = LineIntegral.inverse(one + xx, -xx), LineIntegral.inverse(one, xx)
    return lines, partial(_over_corners, one, xx)


def _integral_xy(x: Array, y: Array, h1: float, h2: float) -> Array:
    """Return ∬ x y/ρ³."""
    X, Y = ([a * a for a in _sides(*side)] for side in ((x, h1), (y, h2)))
    # -[[ρ]] over the corners, with each difference as (a² - b²)/(a + b), which is always accurate.
    r11, r12, r21, r22 = (np.sqrt(a + b) for a in X for b in Y)
    sums = 1.0 / (r11 + r12) + 1.0 / (r21 + r22)
    return 4.0 * x * h1 * y * h2 * sums / ((r11 + r21) * (r12 + r22))


def integral_log(n: int) -> Array:
    """Return ∫ ln|s| ds from k - ½ to k + ½ for k = 0 … n - 1."""
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
    """Return ∬ one/ρ + xx x²/ρ³ as a difference over the corners.

    For x²/ρ³ it is [[Y asinh(X/|Y|)]], for y²/ρ³ [[X asinh(Y/|X|)]], and for 1/ρ their sum.
    """

    def term(a: Array, b: Array) -> Array:
        safe = np.where(a == 0.0, 1.0, np.abs(a))
        return a * np.arcsinh(b / safe)  # 0 where a is 0.

    (X1, X2), (Y1, Y2) = _sides(x, h1), _sides(y, h2)
    of_xx = term(Y2, X2) - term(Y2, X1) - term(Y1, X2) + term(Y1, X1)
    of_yy = term(X2, Y2) - term(X2, Y1) - term(X1, Y2) + term(X1, Y1)
    return one * (of_xx + of_yy) + xx * of_xx


def _x_over_corners(
    lines: tuple[LineIntegral, LineIntegral], x: Array, y: Array, h1: float, h2: float
) -> Array:
    """Return ∬ x/ρ² = [[½ Y ln(X² + Y²) + X arctan(Y/X)]] for x, y ≥ 0, from integrals on sides."""
    along_x, along_y = lines

    def logarithm(Y: Array) -> Array:
        # At a corner the logarithm is infinite, but its product with Y = 0 is zero.
        return Y * along_x.at(np.where(Y == 0.0, h1, Y), x, h1)

    X1, X2 = np.abs(x - h1 / 2.0), x + h1 / 2.0  # The ends of the part with one sign.
    Y1, Y2 = _sides(y, h2)
    # Near the rectangle the subtracted terms are not large compared to the integral.
    angles = X2 * along_y.at(X2, y, h2) - X1 * along_y.at(X1, y, h2)
    return logarithm(Y2) - logarithm(Y1) + angles


def _sides(x: Array, h: float) -> tuple[Array, Array]:
    return x - h / 2.0, x + h / 2.0
