"""Integrals over a rectangle that is narrow for its distance: those along it, over its width.

With t the distance from a line, s that along it, ρ² = t² + s² and a kernel's integral F along the
rectangle's length as a function of t, ∬ f = h Σ_k (h/2)^2k/(2k+1)! F^(2k)(t) for the width h. At
each end of the length the derivatives are w P(u)/t^m, with a polynomial of u = s²/ρ² and a factor
w = s^i t^j/ρ^(i+j). So a value takes one logarithm or angle, two roots, and a few products. Nearer
by Gauss's rule takes the place of the series.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from math import factorial
from typing import Self

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.expansion import sum_series

# From a distance of t widths on the integrand is analytic in an ellipse whose half axes add up to
# ϱ = 2 t + √(4 t² - 1) half widths, and Gauss's rule errs by ϱ^(-2 nodes).
NEAREST, NODES = 2.0, 10
HIGHEST = 4  # Order of the longest series: it begins at 16.6 widths, where Gauss's rule ends.
NEAR, BY_GAUSS = -2, -1  # The rules that are no order of a series: a closed form, and Gauss's.


def _begin(order: int) -> float:
    """Return the distance, in widths, from which on a series up to this order is exact.

    By Cauchy's estimate, as F is analytic where it is less than t away: what is left out first is
    at most 1/((2k + 1) (2t)^2k).
    """
    k = order + 1
    return float(0.5 * (2.0**54 / (2 * k + 1)) ** (0.5 / k))


BEGINS = {
    NEAR: 0.0,
    BY_GAUSS: NEAREST,
    **{order: _begin(order) for order in range(HIGHEST, -1, -1)},
}


@dataclass(frozen=True)
class LineIntegral:
    """∫ f ds of a kernel f over a length at a distance: α closed + β w over the ends.

    Attributes
    ----------
    alpha, beta : float
    closed : function
        Of t, of s in the middle, the length, and s and ρ at both ends. Its derivative by t is
        w P(u)/t over the ends, with the polynomial `slope`.
    powers : (int, int)
        i and j of w = s^i t^j/ρ^(i+j).
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
        """Return α closed, on the line at the distance t."""
        return self._evaluate([], t, s, length)

    def over_width(self, rule: int, t: Array, s: Array, width: Array, length: float) -> Array:
        """Return the integral over a width, by a rule that is not `NEAR`."""
        P = _polynomials(self)
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
        """Return α closed + w Σ_k e^k P_k(u) over the ends."""
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
def _polynomials(line: LineIntegral) -> list[list[float]]:
    """Return the P_2k(u)/(2k+1)! of all orders k."""
    own = _derivatives(line.powers, (1.0,), 0)
    closed = [np.zeros(1), *_derivatives(line.powers, line.slope, 1)]
    P = [
        np.polynomial.polynomial.polyadd(line.alpha * closed[2 * k], line.beta * own[2 * k])
        / factorial(2 * k + 1)
        for k in range(HIGHEST + 1)
    ]
    return [p.tolist() for p in P]


@cache
def _derivatives(powers: tuple[int, int], first: tuple[float, ...], m: int) -> list[Array]:
    """Return the P_m, P_m+1 … of derivatives w P_m(u)/t^m, from the first."""
    i, j = powers
    u, P = np.polynomial.Polynomial([0.0, 1.0]), np.polynomial.Polynomial(first)
    found = [P]
    for order in range(m, 2 * HIGHEST):
        # w' = w (j - (i + j)(1 - u))/t, and u' = -2 u (1 - u)/t.
        P = (j - (i + j) * (1.0 - u) - order) * P - 2.0 * u * (1.0 - u) * P.deriv()
        found.append(P)
    return [p.coef for p in found]


def _logarithm(
    t: Array, s: Array, length: float, low: Array, high: Array, r1: Array, r2: Array
) -> Array:
    """Return ∫ ds/ρ = ln (r1 + r2 + length)/(r1 + r2 - length)."""
    # The lower one is the sum of r1 + low and r2 - high, which are written as none cancels.
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
    # Where the sum cancels, it is small beside the product: the angle is close to a right one.
    value: Array = np.arctan2(length * t, t * t + low * high)
    return value


def _half_logarithm(
    t: Array, s: Array, length: float, low: Array, high: Array, r1: Array, r2: Array
) -> Array:
    """Return ∫ s/ρ² ds = ln r2/r1."""
    return 0.5 * np.log1p(2.0 * length * s / (r1 * r1))


@cache
def gauss(nodes: int) -> list[tuple[float, float]]:
    """Return the nodes and the weights of Gauss and Legendre's rule on [-½, ½]."""
    s, w = np.polynomial.legendre.leggauss(nodes) / np.array(2.0)
    return list(zip(s.tolist(), w.tolist(), strict=True))
