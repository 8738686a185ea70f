"""The multilevel sparse approximate inverse of a whole line, where all rows of G are equal.

All cells of the line are active. A row of G uses the 15 preceding cells: in blocks of 16, which are
also the aggregates, G is block bidiagonal. All its blocks are equal except those of the first block
and of the last row. So no sparse matrix is needed: G X is a product with two 16 x 16 matrices, and
the set-up computes only three blocks, the first, a middle one and the last. The next level is again
a line c_i K(i-j) c_j with a diagonal, with equal cells except for the first and the last.

`build` would make the same P with 15 neighbours. This form is faster: with 2²⁰ unknowns sparse
matrices take seventy times as long for the set-up and two and a half times for the application.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import toeplitz

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import PIECE, share_slices
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.preconditioners.fsai.build import DEFAULT, Options
from toeplitz_mg.preconditioners.fsai.cellgrid import AGGREGATE as BLOCK
from toeplitz_mg.preconditioners.fsai.levels import Direct
from toeplitz_mg.preconditioners.fsai.rows import refusal
from toeplitz_mg.preconditioners.fsai.stencil import EXACT

BLAS_BLOCKS = 1024  # Blocks in one BLAS product; for larger products BLAS may start own threads.


@dataclass(frozen=True)
class LineMatrix:
    """The matrix with the entries c_i K(i-j) c_j and the diagonal d, for n cells.

    Attributes
    ----------
    kernel : ndarray of shape (n,)
        Coefficients.
    c, d, smooth : ndarray of shape (3,)
        The load of an unknown, the diagonal, and the representation of the vector of ones on this
        level: for the first cell, the cells between, and the last cell.
    """

    kernel: Array
    c: Array
    d: Array
    smooth: Array

    @classmethod
    def of_kernel(cls, kernel: Array) -> "LineMatrix":
        """Return the Toeplitz matrix of a kernel, the matrix of the finest level."""
        return cls(kernel, np.ones(3), np.full(3, kernel[0]), np.ones(3))

    def lags(self, count: int) -> Array:
        """Return the first coefficients; beyond the line they equal the last one."""
        return self.kernel[np.minimum(np.arange(count), len(self.kernel) - 1)]

    def matrix(self) -> Array:
        """Return the dense matrix, shape (n, n)."""
        c, d = np.full((2, len(self.kernel)), np.stack([self.c[1:2], self.d[1:2]]))
        c[0], c[-1], d[0], d[-1] = *self.c[::2], *self.d[::2]
        matrix = toeplitz(self.kernel) * np.outer(c, c)
        np.fill_diagonal(matrix, d)
        return matrix


@dataclass(frozen=True)
class LineLevel:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G for n cells, with the next level for E⁻¹.

    Attributes
    ----------
    n : int
    G : ndarray of shape (3, 16, 32)
        The rows of the first block, a middle one and the last one: their entries in the preceding
        block and in their own.
    W : ndarray of shape (3, 16)
        The vectors w of these blocks.
    coarse : LineLevel or Direct
    """

    n: int
    G: Array
    W: Array
    coarse: "LineLevel | Direct"

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.n, *self.coarse.sizes)

    @property
    def multiplications(self) -> int:
        """The number of multiplications in one application."""
        return 2 * self.n * (BLOCK + 1) + self.coarse.multiplications

    def __call__(self, x: Array) -> Array:
        """Apply the levels to a vector."""
        y = np.empty_like(x)
        self.multiply(x, y)
        return y

    def multiply(self, X: Array, out: Array) -> None:
        """Apply the levels to rows, of shape (..., n), into `out`, contiguous, which may be X."""
        X, out = X.reshape(-1, self.n), out.reshape(-1, self.n)
        y, a = self._multiply_factor(X)
        e = workspace(a.shape, X.dtype)
        self.coarse.multiply(a, e)
        e -= a
        self._multiply_transposed(y, e, out)

    @cached_property
    def _blocks_of_G(self) -> tuple[Array, ...]:
        """The first, a middle and the last diagonal block; a middle and the last one beside it."""
        (_, before, final_before), (first, own, final) = self.G[..., :BLOCK], self.G[..., BLOCK:]
        return first, own, final, before, final_before

    def _multiply_factor(self, X: Array) -> tuple[Array, Array]:
        """Return y = G x for each row, in blocks, of shape (..., m, 16), and a = Wᵀ y."""
        first, own, final, before, final_before = self._blocks_of_G
        w_first, w, w_last = self.W
        m = -(-self.n // BLOCK)
        cut = BLOCK * (m - 1)
        x = X[:, :cut].reshape(-1, m - 1, BLOCK)
        last = np.zeros((len(X), BLOCK), X.dtype)
        last[:, : self.n - cut] = X[:, cut:]
        y = workspace((len(X), m, BLOCK), X.dtype)
        a = workspace((len(X), m), X.dtype)

        def forward(blocks: slice) -> None:
            _multiply(x[:, blocks], own.T, y[:, blocks])
            previous = slice(max(blocks.start - 1, 0), blocks.stop - 1)
            part = workspace((len(X), previous.stop - previous.start, BLOCK), X.dtype)
            _multiply(x[:, previous], before.T, part)
            y[:, previous.start + 1 : blocks.stop] += part
            np.matmul(y[:, blocks], w, out=a[:, blocks])

        share_slices(forward, m - 1, PIECE // BLOCK, X.size)
        y[:, 0] = x[:, 0] @ first.T
        y[:, -1] = x[:, -1] @ final_before.T + last @ final.T
        a[:, 0], a[:, -1] = y[:, 0] @ w_first, y[:, -1] @ w_last
        return y, a

    def _multiply_transposed(self, y: Array, e: Array, out: Array) -> None:
        """Write Gᵀ (y + W e) to the rows of `out`; y and e are changed."""
        first, own, final, before, final_before = self._blocks_of_G
        w_first, w, w_last = self.W
        rows, m, _ = y.shape
        cut = BLOCK * (m - 1)
        y[:, 0] += e[:, :1] * w_first
        y[:, -1] += e[:, -1:] * w_last
        e[:, 0] = e[:, -1] = 0.0  # These two have been added.
        z = out[:, :cut].reshape(-1, m - 1, BLOCK)

        def sum_of(blocks: slice) -> Array:
            part = workspace((rows, blocks.stop - blocks.start, BLOCK), y.dtype)
            np.multiply(e[:, blocks, np.newaxis], w, out=part)
            part += y[:, blocks]
            return part

        def back(blocks: slice) -> None:
            part = sum_of(slice(blocks.start, blocks.stop + 1))
            _multiply(part[:, :-1], own, z[:, blocks])
            product = workspace(part[:, 1:].shape, y.dtype)
            z[:, blocks] += _multiply(part[:, 1:], before, product)

        share_slices(back, m - 1, PIECE // BLOCK, out.size)
        second, last_but_one = sum_of(slice(1, 2))[:, 0], sum_of(slice(m - 2, m - 1))[:, 0]
        z[:, 0] = y[:, 0] @ first + second @ before
        z[:, -1] = last_but_one @ own + y[:, -1] @ final_before
        out[:, cut:] = (y[:, -1] @ final)[:, : self.n - cut]


def _multiply(x: Array, matrix: Array, out: Array) -> Array:
    """Multiply blocks by a matrix, in pieces so small that BLAS starts no threads."""
    whole = x.shape[1] // BLAS_BLOCKS * BLAS_BLOCKS
    if whole:
        pieces = (len(x), -1, BLAS_BLOCKS, BLOCK)
        np.matmul(x[:, :whole].reshape(pieces), matrix, out=out[:, :whole].reshape(pieces))
    np.matmul(x[:, whole:], matrix, out=out[:, whole:])
    return out


def build_line(
    matrix: LineMatrix, dtype: np.dtype[Any], options: Options = DEFAULT
) -> LineLevel | Direct:
    """Build a level and those below it in float64; they are applied in the precision `dtype`."""
    n = len(matrix.kernel)
    if n <= options.direct_on_line:
        return Direct.of(matrix.matrix(), dtype)
    rest = n - (n - 1) // BLOCK * BLOCK  # The number of cells of the last block.
    lags = matrix.lags(2 * BLOCK + 1)
    far = lags[2 * BLOCK]  # τ in the description of the package.

    c, d = (_windows(x, BLOCK, 0, BLOCK) for x in (matrix.c, matrix.d))
    S = (toeplitz(lags[:BLOCK]) - far) * c[:, :, np.newaxis] * c[:, np.newaxis]
    S[:, np.arange(BLOCK), np.arange(BLOCK)] = d - far * c**2
    R = _inverse_factors(S)
    G = np.zeros((3, BLOCK, 2 * BLOCK))
    G[0, :, BLOCK:] = R[0]
    for i in range(BLOCK):
        G[1, i, i + 1 : i + 1 + BLOCK] = R[1, -1]
    G[2, :rest] = G[1, :rest]
    G[2, rest - 1, rest : rest + BLOCK] = R[2, -1]

    c, d, smooth = (
        _windows(x, 2 * BLOCK, BLOCK, BLOCK + rest) for x in (matrix.c, matrix.d, matrix.smooth)
    )
    W = np.einsum("kij,kj->ki", G, smooth)
    norm = np.linalg.norm(W, axis=1)
    W /= norm[:, np.newaxis]
    loads = np.einsum("kij,ki->kj", G, W)
    own = (loads**2 * (d - lags[0] * c**2)).sum(axis=1)
    loads *= c
    own += np.einsum("ki,ij,kj->k", loads, toeplitz(lags[: 2 * BLOCK]), loads)
    totals = loads.sum(axis=1)
    if not totals.min() > 0.0:
        raise refusal("the load of an aggregate is", float(totals.min()))
    E = LineMatrix(_coarsen(matrix, loads[1]), totals / totals[1], own, norm)
    return LineLevel(n, G.astype(dtype), W.astype(dtype), build_line(E, dtype, options))


def _inverse_factors(S: Array) -> Array:
    """Return the inverses of the Cholesky factors of some matrices."""
    try:
        return np.linalg.inv(np.linalg.cholesky(S))
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(S).min())
        raise refusal("an eigenvalue of a neighbourhood is", smallest) from None


def _windows(x: Array, length: int, first: int, stop: int) -> Array:
    """Return values given for the first, middle and last cells, on three windows.

    One window has the first cell at the place `first`, one is in the middle, and one has the last
    cell just before `stop`. Places without a cell have any value.
    """
    windows = np.full((3, length), x[1])
    windows[0, first], windows[2, stop - 1] = x[0], x[2]
    return windows


def _coarsen(matrix: LineMatrix, load: Array) -> Array:
    """Return the coefficients between blocks with this load, shape (m,)."""
    n = len(matrix.kernel)
    m = -(-n // BLOCK)
    beyond = np.full(BLOCK * m - n, matrix.kernel[-1])
    K = np.append(matrix.kernel, beyond).reshape(m, BLOCK)
    # The mean over two blocks weights each lag by its share of the pairs of cells.
    pairs = np.arange(BLOCK, 0, -1) / BLOCK**2
    means = K @ pairs
    means[1:] += K[:-1, 1:] @ pairs[:0:-1]
    means *= load.sum() ** 2
    # Sums of the products of loads, by the lag between their cells.
    products = np.correlate(load, load, "full")
    reach = len(load) - 1
    K = matrix.lags(BLOCK * EXACT + reach)
    for k in range(min(EXACT, m)):
        means[k] = K[np.abs(BLOCK * k + np.arange(-reach, reach + 1))] @ products
    return means
