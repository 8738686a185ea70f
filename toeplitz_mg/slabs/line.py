"""One axis on slabs: its unknowns as the rows of a matrix, of which each rank has some.

A Toeplitz matrix of one axis is one of two: with the unknown number i W + j at the point (i, j) its
coefficients are a[i W + j] for the lag (i, j), where j has both signs. So products on a line are
those of slabs of rows of W, and move as many bytes.

Transforms of a line are made in four steps (see `engine.fourstep`), the short ones along the
columns and along the rows; the frequency k₁ + N₁ k₂ is at the place (k₁, k₂).
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

    Its `slab` is that of the matrix: each rank has the rows that are nearest to its unknowns. Where
    a vector has more numbers than the grid, its `length`, the last rank has these.
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
        """Return the exchange for those of a rank's rows, and so many numbers before them."""
        first = np.where(self._cuts[1:] > self._cuts[:-1], self._cuts[:-1] - before, self._cuts[1:])
        return Intervals(self.slab, self._ends, np.maximum(first, 0), self._cuts[1:])

    def rows(self, x: Array) -> Array:
        """Return this rank's rows, with zeros behind the last number, from its part of a vector."""
        X = np.zeros(self.slab.local, x.dtype)
        seen = self._see().spread(x)
        X.reshape(-1)[: len(seen)] = seen
        return X

    def part(self, X: Array) -> Array:
        """Return this rank's part of a vector, from its rows."""
        first, stop = self._cuts[self.slab.comm.rank :][:2]
        return self._see().collect(X.reshape(-1)[: stop - first])

    def lags(self, c: Array, behind: Array) -> Array:
        """Return the coefficients of the lags (i, j), |j| < W, of this rank's rows i.

        They are given by its part of those of the lags from 0 on, and from 0 down.
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
    """Real transforms of vectors of one axis, extended by zeros, whose frequencies ranks share.

    Those of the places (k₁, k₂), k₁ = 0 … N₁/2: of the others they are the complex conjugates. The
    `length` is N₁ N₂; a vector has `known` numbers, of which the last rank has those that are more
    than the unknowns.
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
        """The frequencies of this rank, as integers."""
        k1 = np.arange(self.frequencies.rows.start, self.frequencies.rows.stop)
        return k1[:, None] + self._n1 * np.arange(self._n2)

    @property
    def have_both(self) -> Array:
        """Whether rows of these have both of two frequencies that are each other's conjugate."""
        return self.numbers[:, :1] * 2 % self._n1 == 0

    @cached_property
    def _turns(self) -> list[tuple[Turn, Array]]:
        """The turns of columns, and the factors between the steps."""
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
        """Return the vector of a transform, cut: `Z` is overwritten."""
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
        """Return Σ a_j exp(-2πijk/N) over all lags of a period, from those of the lags 0 … N/2.

        They are even, and so the sums real, or odd (sign -1).
        """
        half, comm = column.astype(np.float64), self.line.slab.comm
        if comm.rank == 0:
            half[0] *= 0.5
        if comm.rank == comm.size - 1 and self.length == 2 * (self._known - 1):
            half[-1] *= 0.5
        sums = self.forward(half)
        return 2.0 * sums.real if sign > 0 else 2j * sums.imag
