"""Other ways to a log-likelihood: the superfast Schur algorithm alone, and stochastic estimates."""

from importlib import import_module

import numpy as np
from scipy.linalg import eigh_tridiagonal

import toeplitz_mg as tmg
from comparisons.harness.inside import GohbergSemencul, schur_column
from toeplitz_mg._typing import Array

PROBES, STEPS = 10, 100  # Random vectors, and steps of Lanczos's method on each.


def value_by_schur(c: Array, y: Array) -> float:
    """Return the log-likelihood by the superfast Schur algorithm alone."""
    n = len(c)
    x, gamma = schur_column(c)
    logdet = n * np.log(c[0]) + np.arange(n - 1, 0, -1.0) @ np.log1p(-(gamma**2))
    return float(-0.5 * (y @ GohbergSemencul(x).apply(y) + logdet + n * np.log(2 * np.pi)))


def stochastic_logdet(c: Array) -> float:
    """Estimate log det A by Lanczos's method on random signs (stochastic quadrature)."""
    A, n = tmg.ToeplitzOperator(c), len(c)
    rng, total = np.random.default_rng(0), 0.0
    for _ in range(PROBES):
        basis = [rng.choice([-1.0, 1.0], n) / np.sqrt(n)]
        diagonal: list[float] = []
        beside: list[float] = []
        for _ in range(min(STEPS, n)):
            w = A @ basis[-1]
            diagonal.append(float(w @ basis[-1]))
            V = np.array(basis)
            w -= V.T @ (V @ w)
            w -= V.T @ (V @ w)
            size = float(np.linalg.norm(w))
            if size < 1e-12 * diagonal[0]:
                break
            beside.append(size)
            basis.append(w / size)
        values, vectors = eigh_tridiagonal(diagonal, beside[: len(diagonal) - 1])
        total += n * float(vectors[0] ** 2 @ np.log(values))
    return total / PROBES


def logdet_by_linear_operator(c: Array) -> float:
    """Estimate log det A as GPyTorch does above some size, with the settings it has by default."""
    torch, package = import_module("torch"), import_module("linear_operator")
    torch.manual_seed(0)
    with package.settings.max_cholesky_size(0):
        return float(package.operators.ToeplitzLinearOperator(torch.from_numpy(c)).logdet())
