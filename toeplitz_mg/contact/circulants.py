"""Circulants that are near the matrix of steady rolling, and causal factors of their inverses."""

from collections.abc import Sequence
from math import ceil, prod

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import keep_bits, share_slices
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import ToeplitzOperator

WRAPPED = 0.03  # What goes around a circulant comes back so many times as large.
# Addition where nothing slides, over the largest of the symbol and by the number of elements along
# the rolling direction: it bounds the inverse. A fixed one fades what comes from far ahead.
LEAST = 0.5
# Length of the circulants over that of the grid along the rolling direction, and how many elements
# they are longer at least: with all lags it takes as many iterations. Across they have all lags, or
# some narrow contacts of elements that are longer than wide do not converge.
LONGER, GAP = 1.5, 8
PANEL_BYTES = 2**20  # Bytes of a panel of frequencies, or of lines: it stays in the cache.

# For each field that is wanted the pairs of a transform and the eigenvalues of a circulant, whose
# products are added.
Sums = Sequence[Sequence[tuple[Array, Array]]]


class Circulants:
    """Products of fields on a grid with circulants, by fast transforms.

    Rolling is known from the leading edge backwards, so that an inverse that is periodic would have
    its ends disturb each other: what is constant along the rolling direction, where K̂ is zero, most
    of all. So the fields are multiplied by an exponential, K by the same from both sides, and a
    circulant is inverted that has all its lags but the longest: what goes around comes back
    `WRAPPED` times as large.

    Parameters
    ----------
    grid : tuple of int
    dtype : float32 or float64

    Attributes
    ----------
    lengths : tuple of int
        Those of the circulants.
    """

    def __init__(self, grid: tuple[int, ...], dtype: DTypeLike) -> None:
        self._grid, self.dtype = grid, np.dtype(dtype)
        self.lengths = tuple(map(fft.next_fast_len, find_lengths(grid)))
        fade = np.exp(fade_rate(self.lengths[0]) * np.arange(grid[0])).astype(dtype)
        self._fade = fade.reshape(-1, *(1,) * (len(grid) - 1))

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, (..., components, ...), along the last axis."""
        *fields, n = x.shape
        of_fields = fields[: x.ndim - len(self._grid)]
        count_transforms(prod(of_fields), *self.lengths)
        with keep_bits(self.dtype, prod(fields)):
            return fft.rfft((x / self._fade).reshape(*of_fields, -1, n), self.lengths[-1])

    def multiply(self, sums: Sums) -> Array:
        """Return the fields, (k, components, ...), that are sums of circulants times transforms."""
        # A single axis is the last one of two.
        (length, last), n = (1, *self.lengths)[-2:], self._grid[-1]
        number, like = len(sums), sums[0][0][0]
        components, rows, frequencies = like.shape
        count_transforms(number * components, *self.lengths)
        Y = workspace((number, *like.shape), like.dtype)
        fields = np.empty((number, components, rows, n), self.dtype)
        fade = np.broadcast_to(self._fade, self._grid).reshape(rows, n)

        def multiply(columns: slice) -> None:
            known: dict[int, Array] = {}
            for y, terms in zip(Y, sums, strict=True):
                products = []
                for X, eigenvalues in terms:
                    if id(X) not in known:
                        known[id(X)] = fft.fft(X[..., columns], length, axis=1)
                    products.append(known[id(X)] * eigenvalues[..., columns])
                for other in products[1:]:
                    products[0] += other
                y[..., columns] = fft.ifft(products[0], axis=1, overwrite_x=True)[:, :rows]

        def finish(lines: slice) -> None:
            y = fft.irfft(Y[:, :, lines], last)[..., :n]
            np.multiply(y, fade[lines], out=fields[:, :, lines])

        of_column, of_row = (number * components * m * like.itemsize for m in (length, frequencies))
        share_slices(multiply, frequencies, 1 + PANEL_BYTES // of_column, Y.size)
        share_slices(finish, rows, 1 + PANEL_BYTES // of_row, Y.size)
        return fields.reshape(number, components, *self._grid)


def find_lengths(grid: tuple[int, ...]) -> tuple[int, ...]:
    """Return the least lengths of circulants for a grid: across, those of all lags."""
    all_lags, *across = (2 * n - 1 for n in grid)
    return min(max(ceil(LONGER * grid[0]), grid[0] + GAP), all_lags), *across


def find_spectrum(K: ToeplitzOperator, lengths: tuple[int, ...]) -> Array:
    """Return the eigenvalues of the circulant of these lengths that has the lags of K, faded.

    They are of the shape (frequencies, frequencies), those of a single axis along the last one.
    """
    n, *across = K.grid_shape
    longest = find_longest_lag(n, lengths[0])
    lags = np.arange(-longest, longest + 1).reshape(-1, *(1,) * len(across))
    faded = K.lags[n - 1 + lags.ravel()] * np.exp(-fade_rate(lengths[0]) * lags)
    count_transforms(1, *lengths)
    spectrum = fft.rfftn(ToeplitzOperator.from_lags(faded).circulant(lengths))
    bound_from_zero(spectrum, LEAST / n * np.abs(spectrum).max())
    result: Array = spectrum.reshape((1, *lengths)[-2], -1)
    return result


def find_longest_lag(n: int, length: int) -> int:
    """Return the longest lag along an axis of n elements that a circulant of this length has."""
    return min(n, (length + 1) // 2) - 1


def bound_from_zero(spectrum: Array, least: float) -> None:
    """Make the real parts of eigenvalues at least so large, in place.

    Those of K are not negative; of its lags on a long and narrow grid alone some are.
    """
    np.maximum(spectrum.real, 0.0, out=spectrum.real)
    spectrum += least


def find_causal_factor(spectrum: Array, lengths: tuple[int, ...]) -> Array:
    """Return the factor of eigenvalues whose lags along the first axis are those from 0 on.

    The other one, of the lags from 0 down, is the eigenvalues over this one (Wiener and Hopf): the
    logarithm of a product is a sum. Their real parts are to be positive, or it has no branch.
    """
    weights, logarithm = weigh_causally(np.arange(lengths[0]), lengths[0]), np.log(spectrum)
    if len(lengths) == 1:
        causal = fft.rfft(weights * fft.irfft(logarithm, lengths[0]))
    else:
        causal = fft.fft(weights[:, None] * fft.ifft(logarithm, axis=0), axis=0)
    factor: Array = np.exp(causal)
    return factor


def weigh_causally(lags: Array, length: int) -> Array:
    """Return the weights of the lags of a period in the causal part of a logarithm.

    The lag zero is shared: both factors are to depend as little as can be on the frequency across,
    as what is between them, the cut at an edge, does not commute with that.
    """
    weights: Array = np.where(lags == 0, 0.5, (2 * lags <= length).astype(float))
    return weights


def fade_rate(length: int) -> float:
    """Return the rate, for an element, of the exponential that fades what goes around."""
    return float(np.log(WRAPPED) / length)
