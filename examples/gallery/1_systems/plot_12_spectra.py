"""
Spectra of preconditioners
==========================

The iterations of conjugate gradients are told by the eigenvalues of M A: their spread, and how many
lie apart. Here they are of the normal contact problem, on a square and on islands.
"""

# %%
# A grid small enough for dense eigenvalues, and a random half of it.
import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import eigh

import toeplitz_mg as tmg

n = 40
x, y = tmg.halfspace.offsets((n, n), (1.0, 1.0))
full = tmg.ToeplitzOperator(tmg.halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.3))
half = tmg.MaskedOperator(full, np.random.default_rng(0).random((n, n)) < 0.5)
makers = {
    "none": None,
    "T. Chan": tmg.chan_preconditioner,
    "cosine": tmg.cosine_preconditioner,
    "sine": tmg.sine_preconditioner,
    "M": tmg.fft_preconditioner,
    "FSAI": lambda A: tmg.fsai_preconditioner(A, neighbours=12),
}

# %%
# The eigenvalues of M A are those of the pencil (A, M⁻¹).
for title, A in {"square": full, "random half": half}.items():
    fig, ax = plt.subplots(layout="constrained")
    dense = A @ np.eye(A.shape[0])
    for row, (name, make) in enumerate(makers.items()):
        M = np.eye(len(dense)) if make is None else make(A) @ np.eye(len(dense))
        values = eigh(dense, np.linalg.inv((M + M.T) / 2), eigvals_only=True)
        values /= np.median(values)
        ax.semilogx(values, np.full(len(values), row), "|", ms=14)
        print(f"{title:12s} {name:8s} largest over smallest {values[-1] / values[0]:9.1f}")
    ax.set(title=title, xlabel="eigenvalue / median [–]", yticks=range(len(makers)))
    ax.set_yticklabels(makers)
plt.show()
