"""Which preconditioner for the whole of a line, by its symbol."""

from collections.abc import Callable, Iterator
from functools import partial, update_wrapper
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.preconditioners.fsai.line import LONG, decays_slowly
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.positivity import precision, rounding
from toeplitz_mg.preconditioners.schur import schur_column
from toeplitz_mg.preconditioners.spectral import Factor, factor_column, spectral_preconditioner
from toeplitz_mg.preconditioners.symbol import NEGLIGIBLE, sampled_symbol
from toeplitz_mg.preconditioners.trigonometric import (
    cosine_inverse,
    cosine_preconditioner,
    sine_inverse,
    sine_preconditioner,
)

# ‖A x - e₁‖, as `python -m comparisons.default_choice` measures them on its random lines:
WELL_RESOLVED = 0.01  # up to which it is resolved where coefficients do not decrease,
HARDLY_RESOLVED = 100.0  # and up to which the symbol is worth something where they do
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
    if has_zero_at_its_start(samples):
        # At θ = 0, which the sines do not see: 3 to 10 iterations to 1e-8.
        yield by_sine
    elif has_zero_at_its_start(samples[::-1]):
        # The same at θ = π.
        yield by_cosine
    elif decreases(A.c) and decays_exponentially(A.c):
        # An exponential covariance as wide as the matrix, more or less: 2 to 5 iterations.
        yield by_cosine
    elif (factor := factor_column(A, samples)) is not None:
        is_smooth = decreases(A.c)
        if factor.is_inverse and (is_smooth or factor.residual <= WELL_RESOLVED):
            # A positive symbol, resolved by n lags: 1 to 8 iterations.
            yield named(partial(_from_factor, factor=factor), spectral_preconditioner)
        elif not is_smooth:
            # Its lags go on and on, as isolated ones do: the factor is computed exactly.
            yield named(partial(_from_schur), spectral_preconditioner)
        elif factor.residual <= HARDLY_RESOLVED:
            # A covariance as wide as the matrix, with a simple tail: 2 to 6 iterations.
            yield by_cosine


def has_zero_at_its_start(samples: Array) -> bool:
    """Whether samples of a symbol tell of a zero at the first of them, and of no other."""
    first, second = samples[:2]
    return bool(
        first < second / 2
        and second <= samples[2:].min(initial=np.inf) + rounding(samples, samples.dtype)
    )


def decreases(c: Array) -> bool:
    """Whether coefficients are positive and decrease with the lag, until they are negligible.

    As those of a half-space and of most covariances do. They tell of no isolated lag, and of no
    zero of the symbol but where the frequency is high.

    Examples
    --------
    >>> import numpy as np
    >>> decreases(np.exp(-np.arange(100.0)))
    True
    >>> decreases(np.array([3.0, 0.0, 0.0, 1.0]))
    False
    """
    negligible = NEGLIGIBLE * c[0]
    reach = int(np.argmin(c > negligible)) or len(c)
    return bool(
        reach > 1
        and (np.diff(c[:reach]) < 0.0).all()
        and np.abs(c[reach:]).max(initial=0.0) <= negligible
    )


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


def _from_schur(A: ToeplitzOperator, dtype: DTypeLike | None = None) -> GohbergSemencul:
    column = schur_column(A.c.astype(np.float64))[0]
    return Factor(column, 0.0).inverse(precision(A, dtype))
