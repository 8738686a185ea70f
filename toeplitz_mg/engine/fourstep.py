"""The four-step method for long complex transforms, in panels that fit the cache.

With the vector as an N₁ × N₂ matrix x[j₁, j₂] in C order, a transform of length L = N₁ N₂ is

    Z[k₁, k₂] = Σ_j₂ W_N₂^(j₂ k₂) · W_L^(j₂ k₁) · Σ_j₁ W_N₁^(j₁ k₁) x[j₁, j₂],   W_N = exp(-2πi/N),

that is, short transforms of the columns, twiddle factors, and short transforms of the rows. The
eigenvalues are multiplied in the order [k₁, k₂], so that nothing is transposed. Columns are copied
to panels, which stay in the cache while they are transformed. Rows are transformed in blocks, which
stay in the cache too.

Frequencies k + s with a shift s diagonalise the matrices that are circulant except for a factor
exp(-2πis) on the entries that wrap around: circulants for s = 0, skew-circulants for s = 1/2, the
right-angle convolution of `products` for s = 1/4. A shift multiplies x by exp(-2πi j s/L). Of this,
u[j₁] = exp(-2πi j₁ s/N₁) is applied before the transform of the columns, and the twiddle factors
exp(-2πi j₂ (k₁ + s)/L) contain the rest.

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
from toeplitz_mg.engine.threads import share, share_slices
from toeplitz_mg.engine.workspace import workspace

# A sum of products of matrices: the shifts and eigenvalues of the first factors of all terms, then
# those of the second factors, and so on.
Factors = Sequence[tuple[tuple[float, ...], Sequence[Array]]]

# Most bytes of a panel of columns. It fits the cache, and with 512 rows each piece of a row that is
# copied still has two kilobytes.
PANEL_BYTES = 2**20
BLOCK_BYTES = 2**19  # Most bytes of a block of rows; its twiddle factors take the same again.
# Number of blocks after which twiddle factors are computed from their formula. In between they
# follow from those of the previous block, which accumulates rounding errors.
ANCHOR = 32


class FourStep:
    """Transforms of length N₁ N₂ for long rows, one after the other (see `transforms.OneStep`).

    Parameters
    ----------
    rows, columns : int
        N₁ and N₂.
    dtype : complex64 or complex128
    width, height : int, optional
        Columns of a panel and rows of a block; by default as many as stay in the cache.
    """

    def __init__(
        self, rows: int, columns: int, dtype: DTypeLike, *, width: int = 0, height: int = 0
    ) -> None:
        self.dtype, self.shape, self.length = np.dtype(dtype), (rows, columns), rows * columns
        panel, block = (size // self.dtype.itemsize for size in (PANEL_BYTES, BLOCK_BYTES))
        panels = -(-columns * rows // panel)
        # An odd multiple of 4, as with a power of 2 all rows would compete for the same cache sets.
        self.width = width or min(columns, (-(-columns // panels) + 3) // 8 * 8 + 4)
        self.height = height or min(rows, max(2, block // columns))

    def astype(self, dtype: DTypeLike) -> "FourStep":
        """Return the plan for another precision."""
        return self if self.dtype == dtype else FourStep(*self.shape, dtype)

    def weights(self, shift: float) -> Array:
        """Return u = exp(-2πi j₁ s/N₁), shape (N₁, 1)."""
        return _weights(self.shape[0], shift, self.dtype)

    def spectrum(self, real: Array, imag: Array | None, shift: float) -> Array:
        """Return the transform of the vector ``real + i imag``, in the order [k₁, k₂].

        The result is a `workspace`; copy it if it is kept for long.
        """
        X, Y = real.reshape(self.shape), None if imag is None else imag.reshape(self.shape)
        u, W = self.weights(shift), workspace(self.shape, self.dtype)

        def load(columns: slice, P: Array) -> None:
            P.real = X[:, columns]
            P.imag = 0.0 if Y is None else Y[:, columns]
            P *= u

        def transform(rows: slice, twiddles: Array) -> None:
            R = W[rows]
            R *= twiddles
            forward(R)

        self._transform_columns(W, load)
        self._share_rows(transform, shift)
        return W

    def parts(self, spectrum: Array, shift: float) -> tuple[Array, Array]:
        """Return the real and the imaginary part of the inverse transform of a spectrum."""
        real, imag = parts = np.empty((2, *self.shape), self.dtype.char.lower())
        u, W = self.weights(shift) / self.length, workspace(self.shape, self.dtype)

        def transform(rows: slice, twiddles: Array) -> None:
            R = workspace(twiddles.shape, self.dtype)
            np.conjugate(spectrum[rows], out=R)
            forward(R)
            np.multiply(R, twiddles, out=W[rows])

        def store(columns: slice, Q: Array) -> None:
            Q *= u
            real[:, columns] = Q.real
            np.negative(Q.imag, out=imag[:, columns])

        self._share_rows(transform, shift)
        self._transform_columns(W, store=store)
        real, imag = parts.reshape(2, -1)
        return real, imag

    def in_order(self, spectrum: Array) -> Array:
        """Return a spectrum in the order of the frequencies k₁ + N₁ k₂."""
        return spectrum.T.ravel()

    def eigenvalues(self, spectrum: Array) -> Array:
        """Return a spectrum in the form that `multiply` needs."""
        char = self.dtype.char if np.iscomplexobj(spectrum) else self.dtype.char.lower()
        eigenvalues = np.empty(self.shape, char)
        return np.divide(spectrum, self.length, out=eigenvalues, casting="same_kind")

    def multiply(self, X: Array, factors: Factors, out: Array) -> None:
        """Write the products of rows with a sum of matrix products to `out` (see `OneStep`)."""
        *others, last = zip(*(zip(*stage, strict=True) for stage in factors), strict=True)
        for x, y in zip(X, out, strict=True):
            rest = None
            for term in others:
                to = workspace((self.length,), y.dtype)
                self._multiply(x, term, rest, to)
                rest = to.reshape(self.shape)
            self._multiply(x, last, rest, y)

    def _multiply(
        self, x: Array, factors: Sequence[tuple[float, Array]], rest: Array | None, y: Array
    ) -> None:
        """Write the product of a vector with these matrices, plus `rest`, to y."""
        W, first, last = workspace(self.shape, self.dtype), factors[0][0], factors[-1][0]
        u, v, (y_rows, y_end) = self.weights(first), self.weights(last), self._fold(y)
        rows, end = self._fold(x)
        whole = len(rows)

        def load(columns: slice, P: Array) -> None:
            P[:whole] = rows[:, columns]
            if whole < len(P):
                P[whole:] = 0.0
                part = end[columns]
                P[whole, : len(part)] = part
            if first:
                P *= u

        def store(columns: slice, Q: Array) -> None:
            if last:
                Q *= v
            values = np.conjugate(Q, out=Q) if y.dtype.kind == "c" else Q.real
            if rest is not None:
                values += rest[:, columns]
            y_rows[:, columns] = values[: len(y_rows)]
            if len(y_end):
                part = y_end[columns]
                part[...] = values[len(y_rows), : len(part)]

        self._transform_columns(W, load)
        for k, (shift, eigenvalues) in enumerate(factors):

            def transform(rows: slice, twiddles: Array, eigenvalues: Array = eigenvalues) -> None:
                # Transform, scale, and transform the conjugate, which gives the conjugate result.
                R = W[rows]
                R *= twiddles
                forward(R)
                R *= eigenvalues[rows]
                np.conjugate(R, out=R)
                forward(R)
                np.multiply(R, twiddles, out=W[rows])

            self._share_rows(transform, shift)
            if k + 1 < len(factors):
                turn = self.weights(shift).conj() * self.weights(factors[k + 1][0])

                def go_on(columns: slice, Q: Array, turn: Array = turn) -> None:
                    np.conjugate(Q, out=Q)
                    Q *= turn
                    forward(Q, 0)
                    W[:, columns] = Q

                self._transform_columns(W, store=go_on)
        self._transform_columns(W, store=store)

    def _fold(self, x: Array) -> tuple[Array, Array]:
        """Return the full rows of a vector as a matrix, and the remaining entries."""
        columns = self.shape[1]
        whole = len(x) // columns * columns
        return x[:whole].reshape(-1, columns), x[whole:]

    def _transform_columns(
        self,
        W: Array,
        load: Callable[[slice, Array], None] | None = None,
        store: Callable[[slice, Array], None] | None = None,
    ) -> None:
        """Transform columns by panels, read from W or by `load`, written to W or by `store`."""
        rows, columns = self.shape

        def work(part: slice) -> None:
            P = workspace((rows * self.width,), self.dtype)
            P = P[: rows * (part.stop - part.start)].reshape(rows, -1)
            if load is None:
                P[...] = W[:, part]
            else:
                load(part, P)
            forward(P, 0)
            if store is None:
                W[:, part] = P
            else:
                store(part, P)

        share_slices(work, columns, self.width, self.length)

    def _share_rows(self, work: Callable[[slice, Array], None], shift: float) -> None:
        """Call `work` for all blocks of rows k₁, with their twiddle factors."""

        def do(blocks: range) -> None:
            for rows, twiddles in self._blocks(blocks, shift):
                work(rows, twiddles)

        share(do, -(-self.shape[0] // self.height), self.length)

    def _blocks(self, blocks: range, shift: float) -> Iterator[tuple[slice, Array]]:
        """Yield the rows k₁ of each block and its twiddle factors, whose memory is reused."""
        rows, columns = self.shape
        first, step = _twiddles(rows, columns, self.height, shift, self.dtype)
        row = step  # Placeholder: the first block computes its own.
        memory = workspace((self.height, columns), self.dtype)
        # Start at a multiple of ANCHOR, so that no result depends on where a thread starts.
        for block in range(blocks.start // ANCHOR * ANCHOR, blocks.stop):
            start = block * self.height
            stop = min(rows, start + self.height)
            row = row * step if block % ANCHOR else _row_of_twiddles(start, columns, self.length)
            if block < blocks.start:
                continue
            T = memory[: stop - start]
            np.multiply(first[: stop - start], row.astype(self.dtype, copy=False), out=T)
            yield slice(start, stop), T


@lru_cache(maxsize=16)
def _weights(rows: int, shift: float, dtype: np.dtype[Any]) -> Array:
    return np.asarray(np.exp(-2j * np.pi * shift / rows * np.arange(rows))[:, np.newaxis], dtype)


@lru_cache(maxsize=8)
def _twiddles(
    rows: int, columns: int, height: int, shift: float, dtype: np.dtype[Any]
) -> tuple[Array, Array]:
    """Return the twiddle factors of the first block, and their ratio from block to block."""
    L = rows * columns
    angles = np.outer(np.arange(height) + shift, np.arange(columns)) / L
    return np.exp(-2j * np.pi * angles).astype(dtype), _row_of_twiddles(height, columns, L)


def _row_of_twiddles(k1: int, columns: int, L: int) -> Array:
    """Return exp(-2πi j₂ k₁/L) for all j₂, with j₂ k₁ reduced modulo L for accuracy."""
    turns = np.arange(columns, dtype=np.int64) * k1 % L / L
    return np.exp(-2j * np.pi * turns)
