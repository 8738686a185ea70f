"""
The million of unknowns
=======================

Test 1 of the paper: the tangential tractions of a line of 2²⁰ elements under a rigid shift. The
matrix is dense, a million by a million; it is never made. One multigrid cycle with the smoother M̄
costs four products with it and one for the residual, and three cycles are enough.
"""

# %%
# The problem, and a cycle
# ------------------------
# `multigrid` returns a linear operator that approximates the inverse: its repr says what the levels
# are, and the work of a cycle in products with the matrix on the finest grid.
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg

n = 2**20
problem = tmg.contact.problems.test1(n)
start = perf_counter()
cycle = tmg.multigrid(problem.A, pre=0)
print(cycle)

# %%
# The iteration
# -------------
residuals = []
x, info = tmg.richardson(problem.A, problem.b, M=cycle, rtol=1e-8, residuals=residuals)
print(f"info {info}, {len(residuals) - 1} cycles, {perf_counter() - start:.2f} s with the set-up")

# %%
# The tractions are singular at the ends, where the bodies start to slide in truth: an area that
# slips would be found by `contact.friction`.
fig, ax = plt.subplots(layout="constrained")
ax.plot(problem.x[:: n // 2000], x[:: n // 2000])
ax.set(xlabel="x [mm]", ylabel="traction [N/mm²]", ylim=(0, 3 * np.median(x)))

# %%
# The residual is divided by about a thousand in each cycle.
fig, ax = plt.subplots(layout="constrained")
ax.semilogy(np.array(residuals) / np.linalg.norm(problem.b), "o-", lw=2, ms=8)
ax.set(xlabel="cycle", ylabel="relative residual [–]", title="A million unknowns")
ax.xaxis.get_major_locator().set_params(integer=True)
# sphinx_gallery_thumbnail_number = 2
plt.show()
