"""Integrals of the modified Bessel functions K₀ and K₁ over the elements of a line.

With c = cosh t, K₀(s) = ∫ exp(-s c) dt and K₁(s) = ∫ c exp(-s c) dt over all t ≥ 0, so that over an
element from a > 0 to a + w

    ∫ K₀ ds = ∫ exp(-a c) D/c dt,                D = 1 - exp(-w c),
    ∫ s K₁ ds = ∫ exp(-a c) (a D + g/c) dt,      g = 1 - (1 + w c) exp(-w c),
    ∫ s K₀ ds = ∫ exp(-a c) (a D + g/c)/c dt.

All terms are positive, so that nothing cancels. The integrands are analytic within π/2 of the real
t and die out twice exponentially, so that the trapezoidal rule errs by exp(-π²/step) only.
"""

from collections.abc import Iterator
from math import acosh, factorial

import numpy as np
from scipy import special

from toeplitz_mg._typing import Array
from toeplitz_mg.halfspace.expansion import choose, sum_series

STEP = 0.2  # Of the trapezoidal rule: it errs by 4e-22.
FARTHEST = 39.0  # Exponent beyond which exp(-a c) is nothing, 1e-17.
NEAREST = 4  # Elements that are done at once, where those further away are twice as many.
ALIKE = 1.25  # Most that the widths of elements which are done together differ.
BLOCK = 2**15  # Exponentials that are computed at once: they stay in the cache.

# Up to z = w c = 1, g is z² Σ (-1)^k (k + 1)/(k + 2)! z^k: the next term is 1e-17.
G_SERIES = [[(-1.0) ** k * (k + 1) / factorial(k + 2)] for k in range(18)]
# Up to d = 1, ∫ K₀ from 0 to d is d Σ (d/2)^2k/(k!² (2k+1)) (Σ 1/j + 1/(2k+1) - γ - ln d/2), with
# j = 1 … k: the next term is 1e-18.
K0_SERIES = [
    [
        (sum(1.0 / j for j in range(1, k + 1)) + 1.0 / (2 * k + 1) - np.euler_gamma) * weight,
        -weight,
    ]
    for k in range(9)
    for weight in [1.0 / (factorial(k) ** 2 * (2 * k + 1))]
]


def integrate_bessel(
    width: Array, n: int, *, k0: float = 0.0, s_k1: float = 0.0, s_k0: float = 0.0
) -> Array:
    """Return integrals over the elements of a line, the first of which is about zero.

    Parameters
    ----------
    width : ndarray of shape (m,)
        Widths w of an element, upwards.
    n : int
        Elements from w (j - ½) to w (j + ½), j = 0 … n - 1.
    k0, s_k1, s_k0 : float
        Weights of K₀(|s|), of |s| K₁(|s|) and of s K₀(|s|), which is odd.

    Returns
    -------
    ndarray of shape (m, n)
        To rounding, relative to the largest integral of K₀ of the same width.
    """
    integrals = np.zeros((len(width), n))
    if k0 or s_k1:  # The first element has two halves. Of the odd function they cancel.
        half = 0.5 * width
        of_k0 = choose({0: 0.0, 1: 1.0}, half, _from_zero, half)
        # By parts, ∫ s K₁ ds = ∫ K₀ ds - s K₀.
        integrals[:, 0] = 2.0 * ((k0 + s_k1) * of_k0 - s_k1 * half * special.k0(half))
    for waves, elements in _blocks(width, n):
        w = width[waves, None]
        a = w * (np.arange(elements.start, elements.stop) - 0.5)
        c, step = _nodes(float(a[0, 0]))
        z = w * c
        D, of_a = -np.expm1(-z), s_k1 + s_k0 / c
        g = choose({0: 0.0, 1: 1.0}, z, _of_two, z) if s_k1 or s_k0 else 0.0
        factors = np.stack([(k0 * D + of_a * g) / c * step, of_a * D * step], axis=-1)
        exponent = np.multiply.outer(-a, c)
        of_one, of_a = np.moveaxis(np.exp(exponent, out=exponent) @ factors, -1, 0)
        integrals[waves, elements] = of_one + a * of_a
    return integrals


def _blocks(width: Array, n: int) -> Iterator[tuple[slice, slice]]:
    """Cut widths and elements, up to where functions are nothing, into blocks of like exponents."""
    start = 0
    while start < len(width):
        w = float(width[start])
        stop = int(np.searchsorted(width, ALIKE * w, side="right"))
        first, end = 1, int(min(n, FARTHEST / w + 1.5))
        while first < end:
            size = max(BLOCK // len(_nodes(w * (first - 0.5))[0]), 1)
            last = min(max(2 * first, NEAREST), first + size, end)
            step = max(size // (last - first), 1)
            for k in range(start, stop, step):
                yield slice(k, min(k + step, stop)), slice(first, last)
            first = last
        start = stop


def _nodes(a: float) -> tuple[Array, Array]:
    """Return c and the weights of the trapezoidal rule, up to where exp(-a c) is nothing."""
    t = STEP * np.arange(int(acosh(max(FARTHEST / a, 1.0)) / STEP) + 2)
    return np.cosh(t), np.where(t == 0.0, 0.5 * STEP, STEP)


def _from_zero(is_far: int, d: Array) -> Array:
    """Return ∫ K₀ ds from 0 to d, which is at most 1, or is from there on."""
    if is_far:  # The integral to infinity is π/2.
        c, step = _nodes(1.0)
        return np.pi / 2.0 - np.exp(np.multiply.outer(-d, c)) @ (step / c)
    half = 0.5 * d
    return d * sum_series(K0_SERIES, np.log(half), half * half)


def _of_two(is_far: int, z: Array) -> Array:
    """Return 1 - (1 + z) exp(-z), where z is at most 1, or is from there on."""
    if is_far:
        return -np.expm1(-z) - z * np.exp(-z)
    return z * z * sum_series(G_SERIES, z, z)
