"""
Kriging of a field with gaps
============================

A field with Matérn's covariance on a grid, of which a third is missing: the conditional mean fills
the gaps, and conditional draws say how sure it is.
"""

# %%
# The prior, and what was observed of it, with noise.
import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg

n, length, noise = 96, 4.0, 0.01
r = np.sqrt(3) * np.hypot(*np.indices((n, n))) / length
prior = tmg.ToeplitzNormal((1 + r) * np.exp(-r) + noise * (r == 0))
field = prior.rvs(random_state=0)
rng = np.random.default_rng(1)
observed = rng.random((n, n)) > 0.25
observed[30:50, 40:70] = False
seen = np.where(observed, field, np.nan)

# %%
# The mean given what was seen, by conjugate gradients on the mask of it; and draws.
given = prior.conditional(seen)
draws = np.stack([given.rvs(random_state=k) for k in range(4)])
error = np.sqrt(np.mean((given.mean - field)[~observed] ** 2))
print(f"{(~observed).sum()} missing of {n * n}; rms error there {error:.3f}, rms of the field 1.00")


# %%
def draw_pair(**pictures):
    """Draw two fields beside each other."""
    axes = plt.subplots(1, 2, layout="compressed")[1]
    for ax, (title, values) in zip(axes, pictures.items(), strict=True):
        ax.imshow(values.T, origin="lower", cmap="viridis", vmin=-2.5, vmax=2.5)
        ax.set(title=title, xticks=[], yticks=[])


draw_pair(seen=seen, mean=given.mean)

# %%
# A draw is as rough as the truth, of which it keeps what was seen.
draw_pair(draw=draws[0], truth=field)
plt.show()
