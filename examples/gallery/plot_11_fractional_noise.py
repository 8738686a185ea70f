"""
The likelihood of fractional Gaussian noise
===========================================

Long memory from a record of a million values: the Hurst exponent by maximum likelihood, with exact
likelihoods and gradients, in O(n log n) each.
"""

# %%
# The covariance, with derivatives by its variance and by the Hurst exponent H.
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

import toeplitz_mg as tmg
from toeplitz_mg.covariances import FractionalGaussianNoise

n, H = 1_000_000, 0.8
y = tmg.ToeplitzNormal(FractionalGaussianNoise(2.0, H)(n)).rvs(random_state=0)


# %%
# What is minimised, by the logarithms of the variance and of H/(1 - H), which have no bounds. As
# `by_c` is the derivative of the likelihood by the covariances, that by a parameter is a sum.
def negative(parameters, y):
    """Return minus the logarithm of the likelihood over n, and its gradient."""
    variance, H = np.exp(parameters[0]), expit(parameters[1])
    c, by_theta = FractionalGaussianNoise(variance, H).values_and_gradient(len(y))
    value, by_c, _ = tmg.ToeplitzNormal(c).logpdf_and_grad(y)
    return -value / len(y), -np.array([variance, H * (1 - H)]) * (by_theta @ by_c) / len(y)


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
