"""Which preconditioner for the whole of a line, by its symbol."""

from collections.abc import Callable, Iterator
from functools import partial, update_wrapper
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.operators.transforms import near_fast_length
from toeplitz_mg.preconditioners.fsai import fsai_preconditioner
from toeplitz_mg.preconditioners.fsai_line import LONG, decays_slowly
from toeplitz_mg.preconditioners.positivity import precision
from toeplitz_mg.preconditioners.spectral import Factor, factor_column, spectral_preconditioner
from toeplitz_mg.preconditioners.symbol import NEGLIGIBLE, sampled_symbol
from toeplitz_mg.preconditioners.trigonometric import (
    cosine_inverse,
    cosine_preconditioner,
    sine_inverse,
    sine_preconditioner,
)

Array = NDArray[Any]

HARDLY_RESOLVED = 100.0  # ‖A x - e₁‖ up to which the symbol is worth something
EXPONENTIAL = 0.01  # deviation of c_(i-s) c_(i+s) from c_i², relative


class Preconditioner(Protocol):
    """A function that returns a preconditioner of a matrix."""

    __name__: str

    def __call__(self, A: Any, *, dtype: DTypeLike | None = None) -> LinearOperator:
        """Return it, in this precision."""


def of_whole_line(A: ToeplitzOperator) -> Iterator[Preconditioner]:
    """Yield the preconditioners that the symbol of A allows, the fastest first.

    There may be none: where the symbol has no positive samples and no zero at an end, or is not
    resolved by n lags at all.
    """
    if len(A.c) >= LONG and decays_slowly(A.c):
        # Contact, long memory: 4 to 12 iterations, but next to no set-up, and cheap ones.
        yield fsai_preconditioner
    A = A.astype(np.float64)
    samples = sampled_symbol(A, (near_fast_length(len(A.c)),))  # at θ = 0 … π
    by_sine = named(partial(sine_inverse, samples=samples), sine_preconditioner)
    by_cosine = named(partial(cosine_inverse, samples=samples), cosine_preconditioner)
    if samples[0] < samples[1] / 2:
        # A zero at θ = 0, which the sines do not see: 3 to 10 iterations to 1e-8.
        yield by_sine
    elif samples[-1] < samples[-2] / 2:
        # The same at θ = π.
        yield by_cosine
    elif decays_exponentially(A.c):
        # An exponential covariance as wide as the matrix, more or less: 2 to 5 iterations.
        yield by_cosine
    elif (factor := factor_column(A, samples)) is not None:
        if factor.is_inverse:
            # A positive symbol, resolved by n lags: 1 to 6 iterations.
            yield named(partial(_from_factor, factor=factor), spectral_preconditioner)
        elif factor.residual <= HARDLY_RESOLVED:
            # A covariance as wide as the matrix, with a simple tail: 2 to 6 iterations.
            yield by_cosine


def decays_exponentially(c: Array) -> bool:
    """Whether the last coefficients are positive, and an exponential function of the lag."""
    step = len(c) // 4
    first, second, last = c[-1 - 2 * step], c[-1 - step], c[-1]
    return bool(
        last > NEGLIGIBLE * c[0] and abs(first * last - second**2) <= EXPONENTIAL * second**2
    )


def named(quick: partial[LinearOperator], same: Callable[..., LinearOperator]) -> Preconditioner:
    """Return a quicker way to a preconditioner, under its name."""
    return cast(Preconditioner, update_wrapper(quick, same))


def _from_factor(
    A: ToeplitzOperator, factor: Factor, dtype: DTypeLike | None = None
) -> GohbergSemencul:
    return factor.inverse(precision(A, dtype))
