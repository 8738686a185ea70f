"""Doubts of a density: rounding that may be as large as what it is of."""

import warnings

import numpy as np
import scipy.linalg

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.solvers.long_residual import EPS

NOISY = 1e-3  # Rounding of a quadratic form, for each unknown, above which there is a warning.


def warn_of_rounding(norm: float, X: Rows, squares: Array, stacklevel: int) -> None:
    """Warn where yᵀ α may be rounding, of rows α = A⁻¹ y with a matrix of this norm."""
    noise = EPS * norm * np.vecdot(X, X)
    worst = int(noise.argmax()) if len(noise) else 0
    if len(noise) and noise[worst] > NOISY * X.shape[1]:
        warnings.warn(
            f"(y - mean)ᵀ A⁻¹ (y - mean) is {squares[worst]:.6g} with an error of up to "
            f"{noise[worst]:.1e}: A is ill-conditioned, for which a larger c[0] would help",
            scipy.linalg.LinAlgWarning,
            stacklevel=stacklevel,
        )
