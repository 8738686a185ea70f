"""
The likelihood of fractional Gaussian noise
===========================================

Long memory from a record of a million values: the Hurst exponent by maximum likelihood, with exact
likelihoods and gradients, in O(n log n) each.
"""

# %%
# The covariance, and its derivative by H.
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

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


n, H = 1_000_000, 0.8
y = tmg.ToeplitzNormal(2.0 * covariance(n, H)[0]).rvs(random_state=0)


# %%
# What is minimised, by the logarithms of the variance and of H/(1 - H), which have no bounds. As
# `by_c` is the derivative of the likelihood by the covariances, that by a parameter is a sum.
def negative(parameters, y):
    """Return minus the logarithm of the likelihood over n, and its gradient."""
    variance, H = np.exp(parameters[0]), expit(parameters[1])
    c, by_H = covariance(len(y), H)
    value, by_c, _ = tmg.ToeplitzNormal(variance * c).logpdf_and_grad(y)
    return -value / len(y), -variance * np.array([by_c @ c, by_c @ by_H * H * (1 - H)]) / len(y)


# %%
# The beginning of the record says in a moment where to look in all of it, and how the likelihood is
# curved there.
fit = minimize(negative, (0.0, 0.0), args=(y[:16384],), jac=True)
print(f"16384 points: variance {np.exp(fit.x[0]):.3f}, H {expit(fit.x[1]):.4f}")
curvature = {"hess_inv0": 0.5 * (fit.hess_inv + fit.hess_inv.T)}
fit = minimize(negative, fit.x, args=(y,), jac=True, options=curvature)
H = expit(fit.x[1])
print(f"{n} points, {fit.nfev} likelihoods: variance {np.exp(fit.x[0]):.3f}, H {H:.4f}")

# %%
# The likelihood near its largest: the record tells H to some ten-thousandths.
steps = np.array([-0.002, -0.001, 0.001, 0.002])
changes = [-n * (negative((fit.x[0], logit(H + step)), y)[0] - fit.fun) for step in steps]
around, profile = np.insert(H + steps, 2, H), np.insert(changes, 2, 0.0)
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.4), layout="constrained")
left.plot(y[:1500], lw=0.6)
left.set(xlabel="time", title="The record, its beginning")
right.plot(around, profile, "o-")
right.set(xlabel="H", ylabel="log-likelihood, less its largest", title="The likelihood")
plt.show()
