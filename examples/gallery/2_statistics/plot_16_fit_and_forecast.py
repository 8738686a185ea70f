"""
A fit and a forecast
====================

A series with gaps: the parameters of its covariance by maximum likelihood, what the gaps hold, and
a forecast with its intervals.
"""

# %%
# Ten years of months, with a memory of a year and a half and noise; a year and a half is missing.
import matplotlib.pyplot as plt
import numpy as np

from toeplitz_mg import ToeplitzNormal
from toeplitz_mg.covariances import Exponential, WhiteNoise

n = 120
true = Exponential(variance=4.0, length=18.0) + WhiteNoise(variance=0.3)
y = 20.0 + ToeplitzNormal(true(n)).rvs(random_state=3)
y[50:68] = np.nan

# %%
# The fit: estimates with their standard errors.
fit = ToeplitzNormal.fit(y, Exponential(length=5.0) + WhiteNoise())
print(fit.summary())

# %%
# What was observed, and the mean with its interval, in the gap and for two years ahead.
fig, ax = plt.subplots(layout="constrained")
fit.plot(ax, steps=24)
ax.set(xlabel="month", ylabel="value")
plt.show()
