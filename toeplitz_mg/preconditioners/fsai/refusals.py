"""Why a sparse approximate inverse is refused: the errors, and the checks that raise them."""

from collections.abc import Callable
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.positivity import name_for_smooth, require_condition

STEPS = 8  # Steps of inverse iteration, which give the smallest eigenvalue to some per cent.


def require_positive(subject: str, value: float, grid_shape: tuple[int, ...]) -> None:
    """Refuse a kernel for which a number that must be positive is not."""
    if not value > 0.0:
        raise refusal(subject, value, grid_shape)


def refusal(subject: str, value: float, grid_shape: tuple[int, ...]) -> np.linalg.LinAlgError:
    """Return the error for a kernel for which a number that must be positive is not."""
    return np.linalg.LinAlgError(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        f"positive definite, or too smooth a kernel for it; {name_for_smooth(grid_shape)}"
    )


def require_definite(matrix: Array, inverse: Callable[[Array], Array], dtype: Any) -> None:
    """Raise LinAlgError where the inverse of the last matrix may be indefinite in this precision.

    Its condition number is estimated by its 1-norm and some steps of inverse iteration.
    """
    v = np.random.default_rng(0).standard_normal(len(matrix))
    for _ in range(STEPS):
        v = inverse(v / np.linalg.norm(v))
    condition = float(np.abs(matrix).sum(axis=0).max() * np.linalg.norm(v))
    require_condition(condition, dtype, "the coarsest matrix", "chan_preconditioner(A)")
