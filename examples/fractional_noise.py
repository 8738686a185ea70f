"""Fit fractional Gaussian noise to a million points by maximum likelihood.

The covariance is a function of two parameters, and its derivatives are known; the likelihood and
its gradient cost some hundred products each. Run it with another number of points as
``python examples/fractional_noise.py 65536``.
"""

import sys

import numpy as np
from scipy.optimize import minimize

import toeplitz_mg as tmg


def covariance(n, H):
    """Return the covariance of fractional Gaussian noise, and its derivative by H.

    A second difference of k²ᴴ/2, whose digits cancel for lags in the thousands: so it is computed
    from log (1 ± 1/k) = s ± d.
    """
    k = np.arange(2.0, n)
    s, d = 0.5 * np.log1p(-(k**-2)), np.arctanh(1.0 / k)
    power, cosh, sinh = k ** (2 * H), np.cosh(2 * H * d), np.sinh(2 * H * d)
    c = power * (np.expm1(2 * H * s) * cosh + 2.0 * np.sinh(H * d) ** 2)
    by_H = 2.0 * np.log(k) * c + 2.0 * power * np.exp(2 * H * s) * (s * cosh + d * sinh)
    return np.r_[1.0, 4.0**H / 2 - 1.0, c], np.r_[0.0, np.log(2.0) * 4.0**H, by_H]


def negative_logpdf(parameters, y):
    """What is minimised, and its gradient, by the logarithm of the variance and by H."""
    variance, H = np.exp(parameters[0]), parameters[1]
    c, by_H = covariance(len(y), H)
    value, by_c, _ = tmg.ToeplitzNormal(variance * c).logpdf_and_grad(y)
    gradient = np.array([by_c @ (variance * c), by_c @ (variance * by_H)])
    return -value / len(y), -gradient / len(y)


if __name__ == "__main__":
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 10**6
    y = tmg.ToeplitzNormal(2.0 * covariance(n, 0.8)[0]).rvs(random_state=0)
    bounds = [(None, None), (0.01, 0.99)]
    fit = minimize(negative_logpdf, (0.0, 0.5), args=(y,), jac=True, bounds=bounds)
    variance, H = np.exp(fit.x[0]), fit.x[1]
    print(f"n = {n}, {fit.nfev} likelihoods: variance {variance:.4f} (2), H {H:.4f} (0.8)")
