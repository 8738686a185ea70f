"""
Figures 6, 9 and 12 of the paper
================================

Why the FFT preconditioner M is a bad smoother, what deflation does about it, and how the parameter
γ of the row sums is chosen: for 32 elements, with dense eigenvalues.
"""

# %%
# Test 1 of the paper, for G = 1: I - M A does not depend on G.
import matplotlib.pyplot as plt
import numpy as np

import toeplitz_mg as tmg

n = 32
problem = tmg.contact.problems.test1(n)
A = tmg.ToeplitzOperator(problem.material.G * problem.A.c)
dense = A.toarray()


def step(M):
    """Return I - M A, which an iteration multiplies the error by."""
    return np.eye(n) - M @ dense


# %%
# **Figure 6.** Two eigenvalues of I - M A lie far below -1: Richardson's iteration diverges, and
# conjugate gradients remove them in two steps. Their eigenvectors are smooth.
values, vectors = np.linalg.eig(step(tmg.fft_preconditioner(A)))
order = values.real.argsort()
values, vectors = values.real[order], vectors.real[:, order]
print(values[:3])
fig, ax = plt.subplots(layout="constrained")
ax.plot(values, "o")
ax.set(xlabel="index", ylabel="eigenvalue of I - M A")
fig, ax = plt.subplots(layout="constrained")
ax.plot(vectors[:, :2], "o-", ms=4, label=[f"λ = {v:.3f}" for v in values[:2]])
ax.set(xlabel="element", ylabel="eigenvector")
ax.legend()

# %%
# **Figure 9.** Subdomain deflation takes these two to the coarse space, and puts 1 in their place.
deflated = np.sort(np.linalg.eigvals(step(tmg.fft_sd_preconditioner(A))).real)
fig, ax = plt.subplots(layout="constrained")
ax.plot(values, "o", label="I - M A")
ax.plot(deflated, "s", mfc="none", label="I - P M A")
ax.set(xlabel="index", ylabel="eigenvalue")
ax.legend()

# %%
# **Figure 12.** The spectral radius of I - M̄ A over γ. The smallest row sum of M, which is taken,
# is next to the best.
M_bar = tmg.fft_rsm_preconditioner(A)
gammas = np.linspace(0.04, 0.13, 901)
radii = [
    abs(np.linalg.eigvals(step(M_bar) - (gamma - M_bar.gamma) * dense)).max() for gamma in gammas
]
best = gammas[np.argmin(radii)]
print(f"γ taken {M_bar.gamma:.5f} (paper 0.0837), best {best:.4f}")
fig, ax = plt.subplots(layout="constrained")
ax.plot(gammas, radii)
ax.axvline(M_bar.gamma, ls="--", color="tab:orange", label="smallest row sum")
ax.set(xlabel="γ", ylabel="spectral radius of I - M̄ A")
ax.legend()
plt.show()
