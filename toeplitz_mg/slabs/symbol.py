"""The symbol of a matrix on slabs: sums of its coefficients, with distributed frequencies.

The coefficients are even or odd along each axis, and so are their transforms, which are imaginary
along the odd axes. So half of the frequencies of each axis, as real numbers, suffice.
"""

from collections.abc import Sequence
from math import prod

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.embedding import around, cut, split
from toeplitz_mg.operators.symbol import Tail, continue_axis, tail_length
from toeplitz_mg.slabs.intervals import Intervals
from toeplitz_mg.slabs.line import COMPLEX, LongTransform
from toeplitz_mg.slabs.slab import Slab

Parity = tuple[int, ...]  # For each axis 1 if the coefficients are even, -1 if they are odd.
UNITS = (1.0, 1.0j, -1.0, -1.0j)  # Powers of i: a factor i for each axis with odd coefficients.


class GridSymbol:
    """Symbols of blocks on a grid; this rank has some frequencies of the last axis.

    Parameters
    ----------
    slab : Slab
    lengths : sequence of int
        The lengths of the circulant along each axis.
    numbers : sequence of range, optional
        The frequencies; by default one of each pair with equal values.
    """

    def __init__(
        self, slab: Slab, lengths: Sequence[int], numbers: Sequence[range] | None = None
    ) -> None:
        self.slab, self._lengths = slab, tuple(lengths)
        self._numbers = numbers or [range(m // 2 + 1) for m in lengths]
        self._points = tuple(map(len, self._numbers))

    def sample(self, c: Array, parity: Parity, *, is_continued: bool = False) -> Array:
        """Return the symbol of a block from this rank's rows of its coefficients.

        Missing coefficients lie on a straight line to those of the opposite lags. With
        `is_continued`, which needs even lengths, they are those of `continue_axis`.
        """
        slab = self.slab
        if is_continued:
            c = _continue_line(slab, c, self._lengths[0] // 2)
            longer = self._lengths[0] // 2 + 1  # The last rank has the new rows.
            starts = np.append(slab.starts[:-1], longer)
            slab = slab.alike((longer, *slab.shape[1:]), starts)
            for axis in range(1, c.ndim):
                c = continue_axis(c, axis, self._lengths[axis] // 2)
        for axis in reversed(range(1, c.ndim)):
            c = self._sums(c, axis, parity[axis])
        mine = self.slab.columns(self._points[-1])
        S = np.empty((*self._points[:-1], mine.stop - mine.start))
        for own, turn in self.slab.turns_of(self._points, COMPLEX):
            S[..., own] = self._sums(slab.to_columns(c, turn), 0, parity[0])
        return S * unit if (unit := _unit(parity)) != 1.0 else S

    def lags(self, S: Array, parity: Parity) -> Array:
        """Return this rank's rows of the coefficients of a block from its symbol."""
        S = (S / _unit(parity)).real
        rows = np.empty((self.slab.local[0], *self._points[1:]))
        for own, turn in self.slab.turns_of(self._points, COMPLEX):
            self.slab.to_rows(self._lags(S[..., own], 0, parity[0]), rows, turn)
        for axis in range(1, rows.ndim):
            rows = self._lags(rows, axis, parity[axis])
        return rows

    def _sums(self, c: Array, axis: int, sign: int) -> Array:
        """Return the sums over all lags along an axis, without the factor i of odd ones."""
        length, numbers = self._lengths[axis], self._numbers[axis]
        wanted = cut(axis, numbers.start, numbers.stop)
        if length == 2 * (c.shape[axis] - 1):
            return fourier.dctn(c, type=1, axes=[axis])[wanted]
        ahead, behind = split(NUMPY, c, axis, sign)
        column = around(NUMPY, ahead, behind, axis, length, is_straight=True)
        sums = fourier.rfft(column, axis=axis)[wanted]
        return sums.real if sign > 0 else sums.imag

    def _lags(self, S: Array, axis: int, sign: int) -> Array:
        lags = fourier.irfft(S if sign > 0 else 1j * S, self._lengths[axis], axis)
        return lags[cut(axis, 0, self.slab.shape[axis])]


class LineSymbol:
    """Symbols of blocks on one axis; this rank has some frequencies of a `LongTransform`."""

    def __init__(self, slab: Slab, lengths: Sequence[int]) -> None:
        (self._length,) = lengths
        self.slab = slab
        self._transform = LongTransform(slab, self._length // 2 + 1, self._length)

    def sample(self, c: Array, parity: Parity, *, is_continued: bool = False) -> Array:
        """Return the symbol of a block from this rank's part of its coefficients."""
        sign, c, n = prod(parity), c.reshape(-1), prod(self.slab.shape)
        if is_continued:
            c = _continue_line(self.slab, c, self._length // 2)
        elif self.slab.comm.rank == self.slab.comm.size - 1:
            # A straight line from the last coefficient to that of the opposite lag.
            t = np.arange(1.0, self._length // 2 - n + 2) / (self._length - 2 * n + 2)
            c = np.concatenate([c, c[-1] + t * (sign - 1) * c[-1]])
        return self._transform.sums(c, sign)

    def lags(self, S: Array, parity: Parity) -> Array:
        """Return this rank's part of the coefficients of a block from its symbol."""
        c = self._transform.backward(np.array(S, complex))
        return c[: prod(self.slab.local)].reshape(self.slab.local)


def _unit(parity: Parity) -> complex:
    return UNITS[parity.count(-1) % 4]


def _continue_line(slab: Slab, c: Array, length: int) -> Array:
    """Continue the first axis to the lags 0 … `length`, on the last rank (see `continue_axis`).

    This must come before the other axes and before any transform, or the result would differ.
    """
    ends = slab.starts * (len(c) // slab.local[0])
    stop = np.full(slab.comm.size, known := ends[-1])
    first = np.append(stop[1:], max(0, known - 2))  # The last rank uses the last two.
    last = Intervals(slab, ends, first, stop).spread(c)
    if slab.comm.rank < slab.comm.size - 1:
        return c
    return np.concatenate([c, continue_axis(last, 0, length - known + len(last))[len(last) :]])


def sum_line(slab: Slab, c: Array, length: int) -> Array:
    """Return this rank's part of `sum_tail`, or of the continued coefficients if it has no tail."""
    n = prod(slab.shape)
    ends = slab.starts * (n // slab.shape[0])
    everywhere = np.full(slab.comm.size, n)
    last = Intervals(slab, ends, everywhere - tail_length(n), everywhere).spread(c)
    if (tail := Tail.of(slab.gather(c[0])[0], last, n)) is None:
        return _continue_line(slab, c, length)
    start = ends[slab.comm.rank]
    is_last = slab.comm.rank == slab.comm.size - 1
    lags = np.arange(float(start), length + 1.0 if is_last else start + len(c))
    sums = np.concatenate([c, tail.beyond(lags[len(c) :])]) + tail.of_periods(lags, length)
    # The negative lags; lag 0, which the tail does not cover, is shifted by a period.
    back = np.where(lags > 0.0, 2.0 * length - lags, 0.0)
    first = np.where(lags > 0.0, tail.beyond(np.maximum(back, length)), 0.0)
    return sums + first + tail.of_periods(back, length)
