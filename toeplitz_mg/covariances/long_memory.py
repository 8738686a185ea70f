"""Fractional Gaussian noise, and the covariances of fractional differences, with all digits."""

from math import comb, exp
from typing import Any

import numpy as np
from scipy.special import bernoulli, gamma, gammaln, psi, zeta

from toeplitz_mg._typing import Array
from toeplitz_mg.covariances.base import Derivatives, Kernel, Lags

# The lag from which a series in 1/k² is summed, and its terms: the next are below rounding.
NOISE_LAG, NOISE_TERMS = 4, 24  # Second differences of k²ᴴ.
DIFFERENCE_LAG, DIFFERENCE_TERMS = 32, 8  # log Γ(k + d) - log Γ(k + 1 - d).


class FractionalGaussianNoise(Kernel):
    """Fractional Gaussian noise, the increments of fractional Brownian motion.

    At the lag of k steps the covariance is ``σ²/2 (|k + 1|²ᴴ - 2 |k|²ᴴ + |k - 1|²ᴴ)``, without the
    digits that this formula loses. It is a process on one axis, in steps: `spacing` does not change
    it.

    Parameters
    ----------
    variance, hurst : float
        σ², of an increment over one step, and H, between 0 and 1: white noise for ½, long memory
        above.

    See Also
    --------
    ARFIMA : long memory with short memory beside it.

    References
    ----------
    B. B. Mandelbrot, J. W. Van Ness, Fractional Brownian motions, fractional noises and
    applications, SIAM Rev. 10 (1968).

    Examples
    --------
    >>> from toeplitz_mg.covariances import FractionalGaussianNoise
    >>> FractionalGaussianNoise(hurst=0.8)(3).round(4)
    array([1.    , 0.5157, 0.3683])
    """

    def __init__(self, variance: Any = 1.0, hurst: Any = 0.75) -> None:
        super().__init__(variance=variance, hurst=hurst)

    def _derive(self, lags: Lags, wanted: frozenset[str]) -> tuple[Array, Derivatives]:
        (hurst,) = self._values("hurst")
        rho, by_hurst = fractional_noise(lags.steps("FractionalGaussianNoise"), hurst)
        return rho, {"hurst": by_hurst}


def fractional_noise(n: int, H: float) -> tuple[Array, Array]:
    """Return the correlations of fractional Gaussian noise, and their derivatives by H."""
    first, a, b = min(NOISE_LAG, n), 2.0 * H, 2.0 * (H - 0.5)  # b = 2H - 1, without an error.
    rho, by_H = np.ones(n), np.zeros(n)
    t = np.arange(first + 1.0)
    log_t = np.log(np.maximum(t, 1.0))
    # t^a/2 less a linear function that leaves no digits to cancel, where t > 0.
    power = 0.5 * np.expm1(a * log_t) if a < 0.5 else 0.5 * t * np.expm1(b * log_t)
    if a < 0.5:
        power[0] = -0.5
    rho[1:first], by_H[1:first] = np.diff(power, 2), np.diff(log_t * np.exp(a * log_t), 2)
    k = np.arange(float(first), n)
    # Σ binom(a, 2j) k^(a - 2j) = H b k^(a - 2) S, S a series in 1/k² whose terms have one sign.
    terms, by_a = [1.0], [0.0]
    for j in range(1, NOISE_TERMS):
        divisor = (2 * j + 2) * (2 * j + 1)
        ratio, by_ratio = (a - 2 * j) * (a - 2 * j - 1) / divisor, (2 * a - 4 * j - 1) / divisor
        by_a.append(by_a[-1] * ratio + terms[-1] * by_ratio)
        terms.append(terms[-1] * ratio)
    u, power = 1.0 / (k * k), k ** (b - 1.0)
    series, by_series = np.polyval(terms[::-1], u), np.polyval(by_a[::-1], u)
    rho[first:] = H * b * power * series
    by_H[first:] = power * ((2.0 * a - 1.0) * series + a * b * (np.log(k) * series + by_series))
    return rho, by_H


def fractional_difference(n: int, d: float) -> tuple[Array, Array]:
    """Return the covariances of (1 - B)^-d e, e white noise of variance 1, and ∂/∂d.

    γ₀ = Γ(1 - 2d)/Γ(1 - d)², γ_k = γ₀ d w_k with w_k = Γ(1 - d)/Γ(1 + d) Γ(k + d)/Γ(k + 1 - d).
    """
    variance = exp(gammaln(1.0 - 2.0 * d) - 2.0 * gammaln(1.0 - d))
    if abs(d) < 0.1:  # The difference of digammas by its series, which has no cancellation.
        i = np.arange(1.0, 40.0)
        slope = 2.0 * float(zeta(i + 1.0) * (2.0**i - 1.0) @ d**i)
    else:
        slope = 2.0 * (psi(1.0 - d) - psi(1.0 - 2.0 * d))
    rho, by_d = np.ones(n), np.zeros(n)  # Correlations.
    j = np.arange(1.0, min(DIFFERENCE_LAG, n))
    w = np.cumprod(np.append(1.0, j[1:] - 1.0 + d)[: len(j)] / (j - d))
    sums = np.cumsum(np.append(0.0, 1.0 / (j[1:] - 1.0 + d))[: len(j)] + 1.0 / (j - d))
    first = len(j) + 1
    rho[1:first], by_d[1:first] = d * w, w * (1.0 + d * sums)
    k = np.arange(float(first), n)
    # log Γ(k + d) - log Γ(k + 1 - d) = (2d - 1) log k - Σ 2 B_(i+1)(d)/(i (i + 1)) k^-i, even i.
    numbers = bernoulli(2 * DIFFERENCE_TERMS + 1)
    even, degrees = range(2, len(numbers) - 1, 2), range(len(numbers))
    at_d = [sum(comb(m, j) * numbers[j] * d ** (m - j) for j in degrees[: m + 1]) for m in degrees]
    series = [-2.0 * at_d[i + 1] / (i * (i + 1)) for i in even]
    by_series = [-2.0 * at_d[i] / i for i in even]
    u = 1.0 / (k * k)
    factor = gamma(1.0 - d) / gamma(1.0 + d)
    w = factor * k ** (2.0 * (d - 0.5)) * np.exp(u * np.polyval(series[::-1], u))
    by_log = 2.0 * np.log(k) + u * np.polyval(by_series[::-1], u) - psi(1.0 - d) - psi(1.0 + d)
    rho[first:], by_d[first:] = d * w, w * (1.0 + d * by_log)
    return variance * rho, variance * (slope * rho + by_d)
