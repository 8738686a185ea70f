"""Facts about a matrix and a mask that decide which preconditioner is taken: pure functions."""

from collections.abc import Iterator

import numpy as np

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators.positivity import rounding
from toeplitz_mg.operators.symbol import NEGLIGIBLE

SMOOTH = 1.9  # Largest ratio of the falls at two doublings of the lag: of a parabola 4, a tent 2.
FAST = 0.2  # Least ratio of the coefficients at a lag and at half of it: less is fast decay.
EXPONENTIAL = 0.01  # Largest deviation of c_(i-s) c_(i+s) from c_i², over c_i²: of exp(-k/ℓ) none.


def decreases(c: Array) -> bool:
    """Whether coefficients are positive and decrease with the lag, until they are negligible.

    Those of a half-space and of most covariances do. Such coefficients tell of no isolated lag, and
    of no zero of the symbol but where the frequency is high.

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
    """Whether coefficients decay as a power of the lag does, or its logarithm, from lag 0 on.

    This is judged at the lags 0, 1, 2, 4 and so on: at each doubling they fall, by less than twice
    what they just did, as they would where the kernel is smooth, and not to nearly nothing.

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
    """Whether the last coefficients are positive, and an exponential function of the lag."""
    step = len(c) // 4
    if not c[0] > 0.0:
        return False
    # Over the first one, as products of the largest and smallest numbers are none.
    with np.errstate(over="ignore", invalid="ignore"):
        first, second, last = np.array([c[-1 - 2 * step], c[-1 - step], c[-1]]) / c[0]
    return bool(last > NEGLIGIBLE and abs(first * last - second**2) <= EXPONENTIAL * second**2)


def has_zero_at_start(samples: Array) -> bool:
    """Whether samples of a symbol tell of a zero at the first of them, and of no other."""
    first, second = samples[:2]
    return bool(
        first < second / 2
        and second <= samples[2:].min(initial=np.inf) + rounding(samples, samples.dtype)
    )


def has_slow_length(grid_shape: tuple[int, ...]) -> bool:
    """Whether the transforms along an axis of a grid are slow, because of a large prime factor."""
    return any(near_fast_length(n) != n for n in grid_shape)


def fragmentation(mask: Mask) -> float:
    """Return the edges between elements of a mask and others, over the root of the elements.

    On two axes it is the length of the edge over the root of the area: 4.0 of a square, 4.5 of a
    circle, and 7.8 of an annulus.

    Examples
    --------
    >>> import numpy as np
    >>> fragmentation(np.ones((9, 9), dtype=bool))
    4.0
    """
    padded = np.pad(mask, 1)
    edges = sum(np.count_nonzero(np.diff(padded, axis=k)) for k in range(mask.ndim))
    return float(edges / np.count_nonzero(mask) ** (1.0 - 1.0 / mask.ndim))
