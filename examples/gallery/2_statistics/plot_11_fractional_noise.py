"""
The likelihood of fractional Gaussian noise
===========================================

Long memory from a record of a million values: the Hurst exponent by maximum likelihood, with exact
likelihoods and gradients, in O(n log n) each.
"""

# %%
# A record of fractional Gaussian noise with the Hurst exponent H.
import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg
from toeplitz_mg.covariances import FractionalGaussianNoise

n, H = 1_000_000, 0.8
y = tmg.ToeplitzNormal(FractionalGaussianNoise(2.0, H)(n)).rvs(random_state=0)

# %%
# The beginning of the record says in a moment where to look in all of it: the estimate is the start
# of the second fit, which takes two steps.
first = tmg.ToeplitzNormal.fit(y[:16384], FractionalGaussianNoise(), mean=0.0)
fit = tmg.ToeplitzNormal.fit(y, first.covariance, mean=0.0)
for found in (first, fit):
    H, error = found.params["hurst"], found.std_errors["hurst"]
    print(f"{found.n_observed} points: H {H:.4f} ± {error:.4f}")

# %%
# The likelihood near its largest: the record tells H to some ten-thousandths.
around = H + np.array([-0.002, -0.001, 0.0, 0.001, 0.002])
covariances = [fit.covariance.with_theta([fit.params["variance"], each]) for each in around]
values = np.array([tmg.ToeplitzNormal(k(n)).logpdf(y) for k in covariances])
fig, ax = plt.subplots(layout="constrained")
ax.plot(around, values - fit.loglikelihood, "o-", lw=2, ms=8)
ax.set(xlabel="Hurst exponent H [–]", ylabel="log-likelihood", title="A million values")
ax.locator_params(axis="x", nbins=4)

# %%
# The beginning of the record.
fig, ax = plt.subplots(layout="constrained")
ax.plot(y[:1500], lw=0.6)
ax.set(xlabel="time", ylabel="value")
plt.show()
