"""Stochastic estimate of a log-determinant with noise that differs from point to point."""

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.gaussian.observed import Observed
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.positivity import lanczos

STEPS = 60  # Steps of Lanczos' method for each random vector.


def estimate_logdet(
    A: ToeplitzOperator, known: Observed, mask: Mask, rest: Array, draws: Rows
) -> tuple[float, float]:
    """Estimate log det (A + D)_oo, and its standard error.

    It is log det A_oo + tr log K with K = A_oo^(-1/2) (A + D)_oo A_oo^(-1/2). A sample z of the
    process of A is A_oo^(1/2) w with a standard normal w, so Lanczos' method in the inner product
    of A_oo⁻¹ gives a quadrature for wᵀ log K w. Its correlation with wᵀ K w, whose mean tr K is
    known exactly, reduces the variance. A includes the uniform part of the noise, and D is the
    diagonal `rest`. `known` is the covariance at the observed points of `mask`; the rows of `draws`
    are samples of the process of A.

    References
    ----------
    S. Ubaru, J. Chen, Y. Saad, Fast estimation of tr(f(A)) via stochastic Lanczos quadrature, SIAM
    J. Matrix Anal. Appl. 38 (2017).
    """
    n = len(mask)
    inverse = LinearOperator((n, n), lambda z: known.solve(z[np.newaxis])[0][0], dtype=np.float64)
    whole = LinearOperator((n, n), lambda z: (A @ z + rest * z) * mask, dtype=np.float64)
    size = int(np.count_nonzero(mask))
    logs, traces, cut = np.empty((3, len(draws)))
    for k, z in enumerate(draws * mask):
        diagonal, beside = lanczos(inverse, whole, z, STEPS)
        for steps in ((len(diagonal) + 1) // 2, len(diagonal)):
            values, vectors = eigh_tridiagonal(diagonal[:steps], beside[: steps - 1])
            cut[k], logs[k] = logs[k], size * (vectors[0] ** 2 @ np.log(values))
        traces[k] = size * (diagonal[0] - 1.0)
    off = traces - known.inverse_diagonal() @ rest
    spread = off - off.mean()
    slope = spread @ logs / max(spread @ spread, np.finfo(np.float64).tiny)
    logs -= slope * off
    error = logs.std(ddof=1) / np.sqrt(len(logs)) + abs(np.mean(logs + slope * off - cut))
    return known.logdet() + float(logs.mean()), float(error)
