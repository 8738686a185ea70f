"""Properties of a matrix and a mask that decide the choice of a preconditioner."""

from collections.abc import Iterator

import numpy as np

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators.positivity import rounding
from toeplitz_mg.operators.symbol import NEGLIGIBLE

SMOOTH = 1.9  # Largest ratio of the decreases over two successive doublings: parabola 4, tent 2.
FAST = 0.2  # Least ratio of the coefficients at a lag and at half of it; below is fast decay.
EXPONENTIAL = 0.01  # Largest |c_(i-s) c_(i+s) - c_i²|/c_i²; for exp(-k/ℓ) it is zero.


def decreases(c: Array) -> bool:
    """Whether coefficients are positive and decrease with the lag until they are negligible.

    Those of a half-space and of most covariances do. Such coefficients have no isolated lags, and
    their symbol can be zero only at high frequencies.

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


def along_axes(c: Array) -> Iterator[Array]:
    """Yield the coefficients along each axis, at the lag 0 along the others."""
    for axis in range(c.ndim):
        yield c[tuple(slice(None) if k == axis else 0 for k in range(c.ndim))]


def decays_slowly(c: Array) -> bool:
    """Whether coefficients decay like a power or the logarithm of the lag, from lag 0 on.

    They are compared at the lags 0, 1, 2, 4, …. At each doubling they must decrease, by less than
    twice the previous decrease (a smooth kernel would exceed that), and not to nearly zero.

    Examples
    --------
    >>> import numpy as np
    >>> decays_slowly(1.0 / (1.0 + np.arange(1000)))
    True
    >>> decays_slowly(0.99 ** np.arange(1000))
    False
    """
    powers = 2 ** np.arange((len(c) - 1).bit_length())
    values = c[np.append(0, powers[powers < len(c)])]
    falls = -np.diff(values)
    return bool(
        values.min() > 0.0
        and (falls > 0.0).all()
        and (falls[1:] <= SMOOTH * falls[:-1]).all()
        and (values[2:] >= FAST * values[1:-1]).all()
    )


def decays_exponentially(c: Array) -> bool:
    """Whether the last coefficients are positive and an exponential function of the lag."""
    step = len(c) // 4
    if not c[0] > 0.0:
        return False
    # Divide by the first one, because products of very large or small numbers overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        first, second, last = np.array([c[-1 - 2 * step], c[-1 - step], c[-1]]) / c[0]
    return bool(last > NEGLIGIBLE and abs(first * last - second**2) <= EXPONENTIAL * second**2)


def has_zero_at_start(samples: Array) -> bool:
    """Whether a symbol has a zero near its first sample, and near no other."""
    first, second = samples[:2]
    return bool(
        first < second / 2
        and second <= samples[2:].min(initial=np.inf) + rounding(samples, samples.dtype)
    )


def has_slow_length(grid_shape: tuple[int, ...]) -> bool:
    """Whether transforms along an axis are slow because its length has a large prime factor."""
    return any(near_fast_length(n) != n for n in grid_shape)


def fragmentation(mask: Mask) -> float:
    """Return the number of edges around a mask, divided by the root of its number of elements.

    On two axes this is the length of the boundary over the root of the area: 4.0 for a square, 4.5
    for a circle, 7.8 for an annulus. On d axes the exponent is 1 - 1/d.

    Examples
    --------
    >>> import numpy as np
    >>> fragmentation(np.ones((9, 9), dtype=bool))
    4.0
    """
    padded = np.pad(mask, 1)
    edges = sum(np.count_nonzero(np.diff(padded, axis=k)) for k in range(mask.ndim))
    return float(edges / np.count_nonzero(mask) ** (1.0 - 1.0 / mask.ndim))
