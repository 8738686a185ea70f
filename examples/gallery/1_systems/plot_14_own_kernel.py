"""
A kernel and a preconditioner of one's own
==========================================

Any kernel on a regular grid is an array of coefficients; a preconditioner is a function of the
operator that returns a linear operator. Both take part in everything.
"""

# %%
# A kernel: a screened potential on a plane, at the offsets of a grid.
import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg
from toeplitz_mg.operators.lifting import lift

i, j = np.indices((96, 96))
r = np.hypot(i, j) + 0.5
A = tmg.ToeplitzOperator(np.exp(-r / 8.0) / r)
print(A)
print(tmg.select_preconditioner(A))


# %%
# A preconditioner: T. Chan's circulant of A after a taper. The decorator takes masks and
# components apart, so that the function sees a Toeplitz operator on its whole grid only.
@lift(accepts="symmetric")
def tapered_preconditioner(A):
    """Return T. Chan's circulant of A, tapered: positive definite, as e^-|k| is a covariance."""
    lag = np.indices(A.lags.shape).T - np.subtract(A.grid_shape, 1)
    taper = np.exp(-np.abs(lag / A.grid_shape).sum(axis=-1)).T
    return tmg.chan_preconditioner(tmg.ToeplitzOperator.from_lags(A.lags * taper), dtype=A.dtype)


# %%
# On a mask, as the preconditioner of `cg`, beside two of the package's own.
ring = tmg.MaskedOperator(A, abs(np.hypot(i - 47.5, j - 47.5) - 32) < 12)
b = np.random.default_rng(0).standard_normal(ring.shape[0])
fig, ax = plt.subplots(layout="constrained")
for make in (tapered_preconditioner, tmg.chan_preconditioner, tmg.default_preconditioner):
    residuals = []
    x, info = tmg.cg(ring, b, M=make(ring), rtol=1e-10, residuals=residuals)
    print(f"{make.__name__:24s}{len(residuals) - 1:4d} iterations")
    name = make.__name__.removesuffix("_preconditioner")
    ax.semilogy(np.array(residuals) / np.linalg.norm(b), "o-", lw=2, ms=5, label=name)
ax.set(xlabel="iteration", ylabel="relative residual [–]")
ax.legend()
plt.show()
