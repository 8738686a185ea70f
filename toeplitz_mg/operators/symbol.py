"""Samples of the symbol of A, with the coefficients continued smoothly instead of cut off."""

from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.engine.embedding import cut
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

STEP = 64  # A tail is fitted at three lags, at a distance of this fraction of the known lags.
NEGLIGIBLE = 1e-9  # Largest coefficient that is neglected, relative to that of lag 0.
SUMMABLE = 1.5  # Least exponent of a power of the lag that a few periods nearly sum up.
PERIODS = 16  # Most periods of 2 n lags over which a tail is summed if n is large.
FEW_LAGS = 2**15  # Lags over which any tail is summed; for small n these are more periods.
SPIKE = 0.5  # If the ratio of the last two coefficients is below this, they define no slope.


def sample_symbol(A: ToeplitzOperator, shape: tuple[int, ...]) -> Array:
    """Return the symbol at θ = πk/n, k = 0 … n along each axis, with n from `shape`."""
    column = average_flips(A)
    xp = (library := A.library).xp
    long_axes = [axis for axis, n in enumerate(column.shape) if n > 1]
    line = xp.reshape(column, (-1,))
    if len(long_axes) == 1 and (sums := sum_tail(line, shape[long_axes[0]])) is not None:
        samples = library.cosine_sums(sums)
        # An axis of one element has no other lags, so the samples are constant along it.
        lengths = tuple(-1 if axis in long_axes else 1 for axis in range(column.ndim))
        whole = xp.broadcast_to(xp.reshape(samples, lengths), tuple(n + 1 for n in shape))
        return xp.asarray(whole, copy=True)
    for axis, n in enumerate(shape):
        column = continue_axis(column, axis, n)
    # By symmetry Σ a_k cos kθ over all lags is a cosine transform of the first column.
    return library.cosine_sums(column)


def symbol_of_line(A: ToeplitzOperator) -> Array:
    """Return the symbol of a matrix of one axis at θ = πk/m, k = 0 … m, with m slightly above n."""
    return sample_symbol(A, (near_fast_length(len(A.c)),))


def sum_tail(column: Array, n: int) -> Array | None:
    """Return the sums of the coefficients and their tail over the lags ±k + 2nj, k = 0 … n.

    The result is None if there is no tail, or one that decays too slowly.
    """
    known, library = column.shape[0], library_of(column)
    last = library.to_numpy(column[-tail_length(known) :])
    if (tail := Tail.of(column[0], last, known)) is None:
        return None
    xp, lags = library.xp, library.arange(2 * n)
    sums = xp.concat([column, tail.beyond(lags[known:])]) + tail.of_periods(lags, n)
    return sums[: n + 1] + xp.concat([sums[:1] - column[:1], xp.flip(sums[n:])])


def tail_length(known: int) -> int:
    """Return the number of last coefficients to which a tail is fitted."""
    return min(known, 2 * max(1, known // STEP) + 1)


def average_flips(A: ToeplitzOperator) -> Array:
    """Return the first column of the even part of A, which is all that cosine transforms use."""
    if A.is_even:
        return A.library.cast(A.c, np.float64)
    flips = _flips(A.library.cast(A.lags, np.float64))
    mean = sum(flips[1:], start=flips[0]) / len(flips)
    return mean[tuple(slice(n - 1, None) for n in A.grid_shape)]


def _flips(lags: Array) -> list[Array]:
    arrays = [lags]
    for axis in range(lags.ndim):
        arrays += [library_of(array).xp.flip(array, axis=axis) for array in arrays]
    return arrays


class Tail:
    """Coefficients beyond the last known lag, which continue the decay of the last ones.

    They follow from the value, the slope and the curvature of their logarithm at one lag: as a
    power of a linear function of the lag, or, for a faster decay, as the exponential of a quadratic
    function. This is exact for the covariances exp(-k/ℓ), exp(-k²/ℓ²) and (1 + k/ℓ)^-p.
    """

    def __init__(self, least: float, fitted_at: int, decay: float, curvature: float) -> None:
        self.value, self.decay, self.curvature = 1.0, decay, curvature
        self._least, self._fitted_at = least, fitted_at

    @classmethod
    def of(cls, first: Any, last: Array, known: int) -> "Tail | None":
        """Fit a tail, given the first and the last `tail_length` of `known` coefficients.

        The result is None if there is no tail, or one that decays too slowly.
        """
        step, least = max(1, known // STEP), NEGLIGIBLE * float(first)
        if known < 4 or not last[-1] > least or not np.all(np.diff(last) < 0):
            return None
        a, b, c = np.log(last[::step]).tolist()
        decay, curvature = (a - c) / (2 * step), (a - 2 * b + c) / step**2
        if curvature * SUMMABLE > decay**2:
            return None
        tail = cls(least, known - 1 - step, decay, curvature)
        tail.value = float(last[-1]) / float(tail.beyond(np.array(known - 1.0)))
        return tail

    def beyond(self, lags: Array) -> Array:
        """Return the coefficients at these unknown lags."""
        t = lags - self._fitted_at
        if self.curvature * 100 < self.decay**2:
            # The exponent would exceed 100: use an exponential function.
            log = (min(self.curvature, 0.0) * t / 2 - self.decay) * t
            return self.value * library_of(t).xp.exp(log)
        exponent = self.decay**2 / self.curvature
        return self.value * (1 + self.decay / exponent * t) ** -exponent

    def of_periods(self, lags: Array, n: int) -> Array:
        """Return the sums over all periods j > 0 of the coefficients at the lags + 2nj."""
        total = 0.0 * lags
        for period in range(1, max(PERIODS, FEW_LAGS // (2 * n))):
            if not float(self.beyond(np.array(2.0 * n * period))) > self._least:
                break
            total += self.beyond(lags + 2.0 * n * period)
        return total


def continue_axis(column: Array, axis: int, n: int) -> Array:
    """Continue an axis to the lags 0 … n, where missing coefficients are not zero.

    They follow the parabola with the slope of the last two coefficients that is flat at lag n. They
    are zero if the last two differ so much that they indicate a spike or an end.
    """
    known = column.shape[axis]
    xp = (library := library_of(column)).xp
    last = column[cut(axis, known - 1)]
    if known == 1:
        # An axis of one element has no other lags.
        return xp.concat([column, xp.zeros_like(last)], axis=axis)
    before = column[cut(axis, known - 2, known - 1)]
    slope = last - before
    is_spike = xp.minimum(abs(last), abs(before)) < SPIKE * xp.maximum(abs(last), abs(before))
    ahead = n - known + 1  # The number of lags from the last coefficient to lag n.
    t = xp.reshape(library.arange(ahead) + 1.0, (-1, *[1] * (column.ndim - 1 - axis)))
    parabola = last + slope * t * (1.0 - t / (2.0 * ahead))
    return xp.concat([column, xp.where(is_spike, xp.zeros_like(last), parabola)], axis=axis)
