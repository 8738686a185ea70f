"""
A class: Toeplitz systems
=========================

What makes a Toeplitz system fast to multiply with, why plain conjugate gradients are slow on it,
and how three ideas mend that. Long enough for an hour and a half; every cell can be changed and
run.
"""

# %%
# A matrix that is never made
# ---------------------------
# The entry of a Toeplitz matrix depends on i - j only, so a column says it all. A product with it
# is a convolution: a leading block of a circulant, which the Fourier transform diagonalises.
import matplotlib.pyplot as plt
import numpy as np
import scipy.fft
import scipy.linalg

import toeplitz_mg as tmg

n = 1000
c = 1.0 / (1.0 + np.arange(n))
v = np.random.default_rng(0).standard_normal(n)

embedding = np.concatenate([c, [0.0], c[:0:-1]])  # Of a circulant of order 2n.
by_hand = scipy.fft.irfft(scipy.fft.rfft(embedding) * scipy.fft.rfft(v, 2 * n))[:n]
dense = scipy.linalg.toeplitz(c) @ v
A = tmg.ToeplitzOperator(c)
print("error by hand", abs(by_hand - dense).max(), "of the operator", abs(A @ v - dense).max())

# %%
# The symbol
# ----------
# The function with the coefficients c is the symbol. The eigenvalues of A lie in its range, and are
# distributed as its samples (Szegő). Here it has a logarithmic peak at 0: a condition number that
# grows, slowly, with n.
theta = np.pi * (np.arange(n) + 0.5) / n
symbol = c[0] + 2 * (c[1:, None] * np.cos(np.outer(np.arange(1, n), theta))).sum(axis=0)
eigenvalues = np.linalg.eigvalsh(scipy.linalg.toeplitz(c))
fig, ax = plt.subplots(layout="constrained")
ax.semilogy(np.sort(symbol), lw=4, label="symbol, sorted")
ax.semilogy(eigenvalues, "--", lw=2, label="eigenvalues")
ax.set(xlabel="index", ylabel="value")
ax.legend()

# %%
# Conjugate gradients without help
# --------------------------------
# The iterations to 10⁻⁸ grow with n. *Exercise: for which symbols do they not?*
sizes = [2**k for k in (8, 10, 12, 14)]


def iterations(column, make, n):
    """Return how many iterations a random right-hand side takes."""
    A = tmg.ToeplitzOperator(column(n))
    b = np.random.default_rng(1).standard_normal(n)
    residuals = []
    M = None if make is None else make(A)
    tmg.cg(A, b, M=M, rtol=1e-8, maxiter=2000, residuals=residuals)
    return len(residuals) - 1


def slow_decay(n):
    """Return the coefficients 1/(1 + k)."""
    return 1.0 / (1.0 + np.arange(n))


print([iterations(slow_decay, None, n) for n in sizes])

# %%
# Idea 1: a circulant near A
# --------------------------
# Strang copies the middle of A's diagonals, T. Chan takes the circulant nearest in the Frobenius
# norm. Each is inverted by two transforms. Eigenvalues cluster, but for those of the ends of the
# line, which a circulant does not have.
for make in (tmg.strang_preconditioner, tmg.chan_preconditioner):
    print(f"{make.__name__:28s}", [iterations(slow_decay, make, n) for n in sizes])

# %%
# Idea 2: the inverse of an embedding
# -----------------------------------
# M is the leading block of the inverse of the circulant in which A stands: two eigenvalues of M A
# are far away, all others near 1. Conjugate gradients do not mind two. The cosine and sine
# transforms sample the symbol on other points, and know two ends.
for make in (tmg.fft_preconditioner, tmg.cosine_preconditioner, tmg.sine_preconditioner):
    print(f"{make.__name__:28s}", [iterations(slow_decay, make, n) for n in sizes])

# %%
# Idea 3: the two ends exactly
# ----------------------------
# The spectral factor of the symbol gives the first column of the inverse of a half-infinite matrix,
# and the Gohberg-Semencul formula an inverse with two ends. FSAI needs no symbol at all: a sparse
# factor on neighbourhoods and a coarse level.
for make in (tmg.spectral_preconditioner, tmg.fsai_preconditioner):
    print(f"{make.__name__:28s}", [iterations(slow_decay, make, n) for n in sizes])

# %%
# A zero of the symbol
# --------------------
# The second difference has the symbol 2 - 2 cos θ, with a zero at 0. A circulant has a frequency
# there; the sine transform does not. Multigrid is made for it, with the interpolation that fits.


def second_difference(n):
    """Return 2, -1, 0, ..."""
    return np.r_[2.0, -1.0, np.zeros(n - 2)]


def cycle(A):
    """Return a multigrid cycle for a zero at θ = 0."""
    jacobi, linear = tmg.jacobi_preconditioner, tmg.linear_interpolation
    return tmg.multigrid(A, smoother=jacobi, interpolation=linear)


for make in (tmg.chan_preconditioner, tmg.sine_preconditioner, cycle):
    print(f"{make.__name__:28s}", [iterations(second_difference, make, n) for n in sizes])

# %%
# All of it in one call
# ---------------------
# `solve_toeplitz` looks at the coefficients, and says what it took. *Exercise: change the
# coefficients until it takes something else.*
for column in (slow_decay, second_difference):
    x, info = tmg.solve_toeplitz(column(2**10), np.ones(2**10), full_output=True)
    print(column.__name__, info)
plt.show()
