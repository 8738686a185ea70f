"""One axis on slabs: its unknowns form the rows of a matrix, and each rank has some of them.

A Toeplitz matrix of one axis is also one of two axes. If the point (i, j) has the number i W + j,
the coefficient of the lag (i, j) is a[i W + j], where j has both signs. So products on a line are
those on slabs of rows of length W, with as much communication.

Transforms of a line are made in four steps (see `engine.fourstep`), with short transforms along the
columns and the rows. The frequency k₁ + N₁ k₂ is stored at (k₁, k₂).
"""

from functools import cached_property
from math import isqrt, prod

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.threads import keep_bits
from toeplitz_mg.slabs.intervals import Intervals
from toeplitz_mg.slabs.slab import Slab, Turn, cuts_of, line_width

COMPLEX = np.dtype(np.complex128).itemsize


class Line:
    """The unknowns of one axis as the rows of a matrix.

    In its `slab` each rank has the rows nearest to its unknowns. If a vector has more entries than
    the grid (`length`), the last rank has the additional ones.
    """

    def __init__(self, slab: Slab, width: int = 0, length: int = 0) -> None:
        ends = slab.starts * (prod(slab.shape) // slab.shape[0])
        ends[-1] = length = length or int(ends[-1])
        self.width = width = width or line_width(length)
        rows = -(-length // width)
        cuts = np.minimum((ends + width // 2) // width, rows)
        cuts[-1] = rows
        self._ends, self._cuts = ends, np.minimum(cuts * width, length)
        self.slab = slab.alike((rows, width), cuts)

    def _see(self, before: int = 0) -> Intervals:
        """Return the exchange for a rank's rows, and for this many entries before them."""
        first = np.where(self._cuts[1:] > self._cuts[:-1], self._cuts[:-1] - before, self._cuts[1:])
        return Intervals(self.slab, self._ends, np.maximum(first, 0), self._cuts[1:])

    def rows(self, x: Array) -> Array:
        """Return this rank's rows from its part of a vector, with zeros behind the last entry."""
        X = np.zeros(self.slab.local, x.dtype)
        seen = self._see().spread(x)
        X.reshape(-1)[: len(seen)] = seen
        return X

    def part(self, X: Array) -> Array:
        """Return this rank's part of a vector from its rows."""
        first, stop = self._cuts[self.slab.comm.rank :][:2]
        return self._see().collect(X.reshape(-1)[: stop - first])

    def lags(self, c: Array, behind: Array) -> Array:
        """Return the coefficients of the lags (i, j), |j| < W, for this rank's rows i.

        `c` and `behind` are its parts of the coefficients of the lags ≥ 0 and ≤ 0.
        """
        (rows, width), before = self.slab.local, self.width - 1
        line = np.zeros((max(rows, 1) + 1) * width - 1)
        seen = self._see(before).spread(c)
        own = self._ends[self.slab.comm.rank]
        near = self.slab.everywhere(behind[: max(0, width - own)])[before:0:-1]
        is_first = rows > 0 and self.slab.rows.start == 0
        start = before if is_first else 0
        line[start : start + len(seen)] = seen
        if is_first:
            line[before - len(near) : before] = near
        return sliding_window_view(line, width + before)[::width][:rows]


class LongTransform:
    """Real transforms of zero-padded vectors of one axis, with distributed frequencies.

    Only the frequencies at (k₁, k₂), k₁ = 0 … N₁/2, are stored; the others are their conjugates.
    The `length` is N₁ N₂. A vector has `known` entries; the last rank has those beyond the
    unknowns.
    """

    def __init__(self, slab: Slab, known: int, length: int, dtype: DTypeLike = np.float64) -> None:
        self._n1 = next(d for d in range(isqrt(length), 0, -1) if length % d == 0)
        self._n2, self._known = length // self._n1, known
        self.length, self.dtype = length, np.dtype(dtype)
        self.line = Line(slab, self._n2, known)
        half = self._n1 // 2 + 1
        self.frequencies = slab.alike((half, self._n2), cuts_of(half, slab.comm.size))

    @property
    def numbers(self) -> Array:
        """The numbers of this rank's frequencies."""
        k1 = np.arange(self.frequencies.rows.start, self.frequencies.rows.stop)
        return k1[:, None] + self._n1 * np.arange(self._n2)

    @property
    def have_both(self) -> Array:
        """Whether each row has both frequencies of conjugate pairs."""
        return self.numbers[:, :1] * 2 % self._n1 == 0

    @cached_property
    def _turns(self) -> list[tuple[Turn, Array]]:
        """The turns of columns, with the twiddle factors between the steps."""
        turns = []
        for _, turn in self.line.slab.turns_of((self._n1, self._n2), COMPLEX):
            k = np.outer(np.arange(self._n1 // 2 + 1), np.arange(*turn[self.line.slab.comm.rank]))
            factors = np.exp(-2j * np.pi / self.length * k).astype(self.dtype.char.upper())
            turns.append((turn, factors))
        return turns

    def forward(self, x: Array) -> Array:
        """Return the transform of a vector."""
        X = self.line.rows(x.astype(self.dtype, copy=False))
        Z = np.empty(self.frequencies.local, self.dtype.char.upper())
        with keep_bits(self.dtype):
            for turn, factors in self._turns:
                C = fourier.rfft(self.line.slab.to_columns(X, turn), self._n1, axis=0)
                C *= factors
                self.frequencies.to_rows(C, Z, turn)
            return fourier.fft(Z, overwrite_x=True)

    def backward(self, Z: Array) -> Array:
        """Return the vector with this transform, cut to its length; `Z` is overwritten."""
        X = np.empty(self.line.slab.local, self.dtype)
        with keep_bits(self.dtype):
            Z = fourier.ifft(Z, overwrite_x=True)
            for turn, factors in self._turns:
                C = self.frequencies.to_columns(Z, turn)
                C *= factors.conj()
                C = fourier.irfft(C, self._n1, axis=0, overwrite_x=True)[: self.line.slab.shape[0]]
                self.line.slab.to_rows(C, X, turn)
        return self.line.part(X)

    def sums(self, column: Array, sign: int = 1) -> Array:
        """Return Σ a_j exp(-2πijk/N) over all lags of a period, given those of the lags 0 … N/2.

        The coefficients are even, so that the sums are real, or odd (`sign` -1).
        """
        half, comm = column.astype(np.float64), self.line.slab.comm
        if comm.rank == 0:
            half[0] *= 0.5
        if comm.rank == comm.size - 1 and self.length == 2 * (self._known - 1):
            half[-1] *= 0.5
        sums = self.forward(half)
        return 2.0 * sums.real if sign > 0 else 2j * sums.imag
