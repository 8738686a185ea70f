"""Why a sparse approximate inverse is refused: the errors, and the checks that raise them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.positivity import name_condition

STEPS = 8  # Steps of inverse iteration, which give the smallest eigenvalue to some per cent.


class Refused(np.linalg.LinAlgError):
    """A matrix has no sparse approximate inverse: why, without what to take in its place."""


@contextmanager
def advise(advice: str) -> Iterator[None]:
    """Say in the error of a matrix that is refused what to take in its place."""
    try:
        yield
    except Refused as error:
        raise np.linalg.LinAlgError(f"{error}; {advice}") from None


def require_positive(subject: str, value: float) -> None:
    """Refuse a kernel for which a number that must be positive is not."""
    if not value > 0.0:
        raise refusal(subject, value)


def refusal(subject: str, value: float) -> Refused:
    """Return the error for a kernel for which a number that must be positive is not."""
    return Refused(
        f"{subject} {value:.3g} in the sparse approximate inverse, but must be positive: A is not "
        "positive definite, or too smooth a kernel for it"
    )


def require_definite(matrix: Array, inverse: Callable[[Array], Array], dtype: Any) -> None:
    """Raise LinAlgError where the inverse of the last matrix may be indefinite in this precision.

    Its condition number is estimated by its 1-norm and some steps of inverse iteration.
    """
    size = float(np.abs(matrix).sum(axis=0).max())
    v = np.random.default_rng(0).standard_normal(len(matrix))
    for _ in range(STEPS):
        # In terms of its size, as the inverse of the smallest numbers has squares that overflow.
        v = size * inverse(v / np.linalg.norm(v))
    condition = float(np.linalg.norm(v))
    if why := name_condition(condition, dtype, "the coarsest matrix"):
        if np.dtype(dtype).char == "f":
            raise np.linalg.LinAlgError(f"{why}: use float64")
        raise Refused(why)
