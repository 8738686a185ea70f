"""The Matérn correlation of any order ν, and its derivatives by the distance and by ν."""

from math import lgamma, log, pi, sqrt

import numpy as np
from numpy.polynomial import chebyshev
from scipy.special import psi

from toeplitz_mg._typing import Array

WIDTH, NODES = 0.5, 18  # Intervals of log r and nodes in each; the error is rounding.
SPACING = 0.2  # Largest step of the trapezoidal rule; it is smaller for a narrow integrand.
GROUP = 8  # Nodes of the trapezoidal rule between two checks for convergence.


def integrate(r: Array, nu: float) -> Array:
    """Evaluate ρ = 2^(1-ν)/Γ(ν) x^ν K_ν(x), x = (2ν)^½ r, and its derivatives.

    K_ν(x) = ∫ exp(-x cosh t) cosh νt dt over t > 0, and ∂K_ν/∂ν, are integrated by the trapezoidal
    rule, whose error is exp(-π²/step) and less; dρ/dx = -2^(1-ν)/Γ(ν) x^ν K_(ν-1)(x).
    """
    x = sqrt(2.0 * nu) * r
    log_x, log_factor = np.log(x), (1.0 - nu) * log(2.0) - lgamma(nu)
    shift = log_x - log(2.0) - psi(nu)  # So that the sum of t and this is 1/(2ν) at the peak.
    peak = np.arcsinh(nu / x)
    # exp(νt - x cosh t) has the curvature (x² + ν²)^½ at its peak.
    step = np.minimum(SPACING, 0.7 / (x * x + nu * nu) ** 0.25)
    rho, slope, by_nu = sums = np.zeros((3, len(x)))
    live, i = np.arange(len(x)), 0
    while len(live):
        t, at = i * step[live], x[live]
        weight = step[live] * (0.25 if i == 0 else 0.5)
        up = weight * np.exp(nu * (t + log_x[live]) + log_factor - at * np.cosh(t))
        down = up * np.exp(-2.0 * nu * t)
        rho[live] += up + down
        slope[live] += at * (up * np.exp(-t) + down * np.exp(t))
        by_nu[live] += up * (shift[live] + t) + down * (shift[live] - t)
        i += 1
        if i % GROUP == 0:
            live = live[(t < peak[live]) | (up * (1.0 + t) > 1e-19 * rho[live])]
    by_nu -= slope / (2.0 * nu)  # Since x depends on ν at constant r.
    return sums


def matern(r: Array, nu: float) -> Array:
    """Return ρ(r), -r ρ'(r) and ∂ρ/∂ν for scaled distances r > 0, as three rows.

    They are analytic in log r in a strip of width π around the real axis, so Chebyshev
    interpolation on short intervals is accurate to rounding.
    """
    u = np.log(r)
    first = u.min()
    place = (u - first) / WIDTH
    index = place.astype(np.intp)
    used = np.flatnonzero(np.bincount(index))
    angles = pi * (np.arange(NODES) + 0.5) / NODES
    at = np.exp(first + WIDTH * (used[:, np.newaxis] + 0.5 + 0.5 * np.cos(angles)))
    samples = integrate(at.ravel(), nu).reshape(3, len(used), NODES)
    weights = 2.0 / NODES * np.cos(np.outer(angles, np.arange(NODES)))
    weights[:, 0] *= 0.5
    coefficients = samples @ weights
    values = np.empty((3, len(r)))
    for j, interval in enumerate(used):
        here = index == interval
        points = 2.0 * (place[here] - interval) - 1.0
        values[:, here] = chebyshev.chebval(points, coefficients[:, j].T)
    return values
