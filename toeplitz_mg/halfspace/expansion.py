"""Integrals over a rectangle from afar: series in the square of its size over the distance.

With the rectangle's Taylor series about its centre, ∬ f = h₁ h₂ Σ_k Σ_{a+b=k} (h₁/2)^2a (h₂/2)^2b
/((2a+1)! (2b+1)!) ∂_x^2a ∂_y^2b f. A kernel is a sum of monomials x^i y^j/ρ^m of degree -1. Where
x^p y^q with p and q of 0 and 1 is taken out of it, and a power of ρ, each derivative is a
polynomial in u = x²/ρ²:

    ∬ f = x^p y^q/ρ^(p+q+1) Σ_k ρ^(-2k) P_k(u).

So a value takes one division, at most one root, and a few products. Nothing in it cancels, in
contrast with a closed form, whose differences over the corners lose digits as (distance/size)².
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import cache
from math import comb, factorial

import numpy as np

from toeplitz_mg._typing import Array

Monomial = tuple[int, int, int]  # (i, j, m) is x^i y^j/ρ^m, and i + j - m = -1.
Kernel = dict[Monomial, float]  # Monomials that are even or odd alike, and their weights.

HIGHEST = 9  # Order of the longest series: it begins at 7.7 half diagonals, and the next at 6.7.


def _reach(order: int) -> float:
    """Return the distance, in half diagonals, from which on a series up to this order is exact.

    The monomials come from harmonic functions by at most two derivatives. So in the unit of the
    half diagonal, what is left out first is at most (2k)² moments/ρ^2k; the moments of order 2k,
    largest of a rectangle that is a line, are at most 1/(2k + 1).
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
    """Return values at points, each by the rule that begins last before its distance.

    Parameters
    ----------
    begins : mapping
        From where on each rule serves, upwards; the first one up to where the second begins.
    distance : ndarray
        Of the points.
    evaluate : function
        Of a rule, and of those of the `points` that it is to serve: arrays of shape (points,), or
        all points in their own shape.
    points : ndarray
        They broadcast to the shape of the distances.
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
    """Return the ∂_x^2a ∂_y^2b of a monomial over 2^2k (2a+1)! (2b+1)!, b = k - a.

    Shape (orders k, a, powers of u); zero where a > k.
    """
    result = np.zeros((HIGHEST + 1, HIGHEST + 1, HIGHEST + 2))
    for k in range(HIGHEST + 1):
        for a in range(k + 1):
            b = k - a
            p = [0] * (HIGHEST + 2)
            for (i, j, _), c in _derivative(monomial, 2 * a, 2 * b).items():
                # x^i y^j is x^(i % 2) y^(j % 2) u^(i // 2) (1 - u)^(j // 2), times a power of ρ.
                for power in range(j // 2 + 1):
                    p[i // 2 + power] += c * comb(j // 2, power) * (-1) ** power
            below = 4**k * factorial(2 * a + 1) * factorial(2 * b + 1)
            result[k, a] = [c / below for c in p]
    return result


@cache
def _derivative(monomial: Monomial, in_x: int, in_y: int) -> dict[Monomial, int]:
    """Return the monomials of a derivative, and their coefficients."""
    if in_x == in_y == 0:
        return {monomial: 1}
    di, dj = (1, 0) if in_x else (0, 1)
    derivative: defaultdict[Monomial, int] = defaultdict(int)
    for (i, j, m), c in _derivative(monomial, in_x - di, in_y - dj).items():
        derivative[i + di, j + dj, m + 2] -= c * m
        if power := di * i + dj * j:
            derivative[i - di, j - dj, m] += c * power
    return derivative
