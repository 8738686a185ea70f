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
    """The covariance of fractional Gaussian noise, and its derivative by H."""
    k = np.abs(np.arange(-1.0, n + 1.0))
    logs = np.log(np.where(k > 0, k, 1.0))  # 0²ᴴ log 0 is 0.
    return np.diff(k ** (2 * H), 2) / 2, np.diff(k ** (2 * H) * logs, 2)


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
