"""The four-step transform: long complex transforms in panels that fit the cache.

A transform of length L = N₁ N₂, the vector as an N₁ × N₂ matrix x[j₁, j₂] in C order, is

    Z[k₁, k₂] = Σ_j₂ W_N₂^(j₂ k₂) · W_L^(j₂ k₁) · Σ_j₁ W_N₁^(j₁ k₁) x[j₁, j₂],   W_N = exp(-2πi/N),

short transforms of the columns, the twiddle factors, and short transforms of the rows. What is
done between it and its inverse, a multiplication by eigenvalues, is done in the order [k₁, k₂], so
that nothing is transposed. The columns are copied to a panel of some of them, which stays in the
cache while it is transformed; so do a few rows at a time.

The frequencies may be shifted, k + s in the place of k, which diagonalises the matrices that are
circulant but for a factor exp(-2πis) on what goes around: s = 0 circulants, 1/2 skew-circulants,
1/4 the right-angle convolution of `products`. The factors exp(-2πi j s/L) of a shift are
u[j₁] = exp(-2πi j₁ s/N₁) before the columns, and the rest is part of the twiddle factors,
exp(-2πi j₂ (k₁ + s)/L).

References
----------
D. H. Bailey, FFTs in external or hierarchical memory, J. Supercomput. 4 (1990).
"""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.fourier import forward
from toeplitz_mg.engine.lengths import near_square
from toeplitz_mg.engine.threads import share
from toeplitz_mg.engine.workspace import workspace

Load = Callable[[slice, Array], None]  # From columns j₂ to a panel (N₁, columns), which it fills.
Factor = tuple[float, Array]  # The shift of a transform, and the eigenvalues.
Store = Callable[[slice, Array], None]  # From a panel, which it may overwrite, to columns j₂.

# Bytes of a panel of columns: it stays in the cache, and with 512 rows each piece of a row still
# has two kilobytes.
PANEL_BYTES = 2**20
BLOCK_BYTES = 2**19  # Bytes of a block of rows, and of its twiddle factors, which share the cache.
# Blocks whose twiddle factors are made one from the other before they are made anew: each step adds
# to the rounding.
ANCHOR = 32


class FourStep:
    """The plan of a transform of length N₁ N₂.

    Parameters
    ----------
    rows, columns : int
        N₁ and N₂.
    dtype : complex64 or complex128
    width, height : int, optional
        The columns of a panel and the rows of a block; by default so many as stay in the cache.
    """

    def __init__(
        self,
        rows: int,
        columns: int,
        dtype: DTypeLike,
        *,
        width: int | None = None,
        height: int | None = None,
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._real = self.dtype.char.lower()
        self.shape = rows, columns
        panel, block = (size // self.dtype.itemsize for size in (PANEL_BYTES, BLOCK_BYTES))
        panels = -(-columns * rows // panel)
        # It is an odd multiple of 4: a power of 2 would bring all rows to one part of the cache.
        self.width = width or min(columns, (-(-columns // panels) + 3) // 8 * 8 + 4)
        self.height = height or min(rows, max(2, block // columns))

    @property
    def length(self) -> int:
        """L = N₁ N₂."""
        return self.shape[0] * self.shape[1]

    def weights(self, shift: float) -> Array:
        """Return u = exp(-2πi j₁ s/N₁), shape (N₁, 1)."""
        return _weights(self.shape[0], shift, self.dtype)

    def spectrum(self, load: Load, shift: float) -> Array:
        """Transform a vector, and return all of it, in the order [k₁, k₂].

        The result is a `workspace`: what is to be kept for long had better be a copy.
        """
        W = workspace(self.shape, self.dtype)
        self._columns_in(W, load)

        def work(blocks: range) -> None:
            for rows, twiddles in self._blocks(blocks, shift):
                R = W[rows]
                R *= twiddles
                forward(R)

        share(work, self._count(0), self.length)
        return W

    def invert(self, spectrum: Array, shift: float, store: Store) -> None:
        """Transform a spectrum, in the order [k₁, k₂], back.

        Parameters
        ----------
        spectrum : ndarray of shape (N₁, N₂)
        shift : float
        store : callable
            Receives a panel Q, which it may overwrite; the columns of the vector are the conjugate
            of u Q over the length.
        """
        W = workspace(self.shape, self.dtype)

        def work(blocks: range) -> None:
            for rows, twiddles in self._blocks(blocks, shift):
                R = workspace(twiddles.shape, self.dtype)
                np.conjugate(spectrum[rows], out=R)
                forward(R)
                np.multiply(R, twiddles, out=W[rows])

        share(work, self._count(0), self.length)
        self._columns_out(W, store)

    def multiply(self, load: Load, factors: Sequence[Factor], store: Store) -> None:
        """Multiply by matrices that shifted transforms diagonalise, the first one first.

        Parameters
        ----------
        load : callable
            Fills a panel with columns of the vector times u of the first shift.
        factors : sequence of (float, ndarray)
            The shift and the eigenvalues, from `eigenvalues`.
        store : callable
            Receives a panel Q, which it may overwrite; the columns of the result are the
            conjugate of u Q, with u of the last shift.
        """
        W = workspace(self.shape, self.dtype)
        self._columns_in(W, load)
        for k, (shift, eigenvalues) in enumerate(factors):
            if k:
                self._columns_through(W, factors[k - 1][0], shift)
            self._rows(W, shift, eigenvalues)
        self._columns_out(W, store)

    def eigenvalues(self, spectrum: Array) -> Array:
        """Prepare a spectrum, in the order [k₁, k₂], for `multiply`."""
        is_complex = np.iscomplexobj(spectrum)
        eigenvalues = np.empty(self.shape, self.dtype.char if is_complex else self._real)
        np.divide(spectrum, self.length, out=eigenvalues, casting="same_kind")
        return eigenvalues

    def transpose(self, Z: Array, out: Array) -> None:
        """Write the first columns of a spectrum as rows: in the order k₁ + N₁ k₂.

        By panels, as Z may have rows that all go to the same part of the cache.
        """

        def work(panels: range) -> None:
            for columns, P in self._panels(panels, len(out)):
                P[...] = Z[:, columns]
                out[columns] = P.T

        share(work, -(-len(out) // self.width), out.size)

    def _columns_in(self, W: Array, load: Load) -> None:
        def work(panels: range) -> None:
            for columns, P in self._panels(panels):
                load(columns, P)
                forward(P, 0)
                W[:, columns] = P

        share(work, self._count(1), self.length)

    def _rows(self, W: Array, shift: float, eigenvalues: Array) -> None:
        """Transform the rows, multiply, and transform back, to the conjugate."""

        def work(blocks: range) -> None:
            for rows, twiddles in self._blocks(blocks, shift):
                R = W[rows]
                R *= twiddles
                forward(R)
                R *= eigenvalues[rows]
                np.conjugate(R, out=R)
                forward(R)
                np.multiply(R, twiddles, out=W[rows])

        share(work, self._count(0), self.length)

    def _columns_through(self, W: Array, shift: float, next_shift: float) -> None:
        """Finish the one inverse transform, and begin the next transform."""
        turn = self.weights(shift).conj() * self.weights(next_shift)

        def work(panels: range) -> None:
            for columns, P in self._panels(panels):
                P[...] = W[:, columns]
                forward(P, 0)
                np.conjugate(P, out=P)
                P *= turn
                forward(P, 0)
                W[:, columns] = P

        share(work, self._count(1), self.length)

    def _columns_out(self, W: Array, store: Store) -> None:
        def work(panels: range) -> None:
            for columns, P in self._panels(panels):
                P[...] = W[:, columns]
                forward(P, 0)
                store(columns, P)

        share(work, self._count(1), self.length)

    def _count(self, axis: int) -> int:
        """Return the number of blocks of rows, or of panels of columns."""
        return -(-self.shape[axis] // (self.width if axis else self.height))

    def _panels(self, panels: range, end: int | None = None) -> Iterator[tuple[slice, Array]]:
        """Yield the columns of each panel, up to `end`, and memory for it, the same for all."""
        rows, columns = self.shape
        memory = workspace((rows * self.width,), self.dtype)
        for start in (panel * self.width for panel in panels):
            stop = min(end or columns, start + self.width)
            yield slice(start, stop), memory[: rows * (stop - start)].reshape(rows, -1)

    def _blocks(self, blocks: range, shift: float) -> Iterator[tuple[slice, Array]]:
        """Yield the rows k₁ of each block, and its twiddle factors, in the same memory for all."""
        rows, columns = self.shape
        first, step = _twiddles(rows, columns, self.height, shift, self.dtype)
        row = step  # Any value will do, as the first block makes its own.
        memory = workspace((self.height, columns), self.dtype)
        # From the last anchor on: what a block has must not depend on the first one of its thread.
        for block in range(blocks.start // ANCHOR * ANCHOR, blocks.stop):
            start = block * self.height
            stop = min(rows, start + self.height)
            row = row * step if block % ANCHOR else _row_of_twiddles(start, columns, self.length)
            if block < blocks.start:
                continue
            T = memory[: stop - start]
            np.multiply(first[: stop - start], row.astype(self.dtype, copy=False), out=T)
            yield slice(start, stop), T


def four_step(length: int, dtype: DTypeLike) -> FourStep:
    """Return the plan for the shortest length not below `length` of two near, fast factors."""
    return FourStep(*near_square(length), dtype)


@lru_cache(maxsize=16)
def _weights(rows: int, shift: float, dtype: np.dtype[Any]) -> Array:
    return np.asarray(np.exp(-2j * np.pi * shift / rows * np.arange(rows))[:, np.newaxis], dtype)


@lru_cache(maxsize=8)
def _twiddles(
    rows: int, columns: int, height: int, shift: float, dtype: np.dtype[Any]
) -> tuple[Array, Array]:
    """Return the twiddle factors of the first block, and those that lead from block to block."""
    L = rows * columns
    angles = np.outer(np.arange(height) + shift, np.arange(columns)) / L
    return np.exp(-2j * np.pi * angles).astype(dtype), _row_of_twiddles(height, columns, L)


def _row_of_twiddles(k1: int, columns: int, L: int) -> Array:
    """Return exp(-2πi j₂ k₁/L) for all j₂, from arguments that are reduced to one turn."""
    turns = np.arange(columns, dtype=np.int64) * k1 % L / L
    return np.exp(-2j * np.pi * turns)
