"""Rows and columns of the inverse of a Toeplitz matrix at some positions, from its first column."""

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.solvers.sharp_column import SharpColumn

NEAR = 64  # Rows of the inverse that take as long, one from the other, as a product.
PANEL = 2**16  # Numbers of the rows that are made at once: they stay in the cache.


def inverse_block(column: SharpColumn, index: Array) -> Array:
    """Return the rows and columns of A⁻¹ at some positions, in ascending order.

    What is below the diagonal is not set. By the Gohberg-Semencul formula each row follows from the
    one above it: with x = A⁻¹ e₁ and xₙ = 0

        (A⁻¹)_ij = (A⁻¹)_(i-1,j-1) + (x_i x_j - x_(n-i) x_(n-j))/x₀.

    The next position is reached row by row where it is near, and by a product where it is far.
    """
    x = column.x
    n, m, last = len(x), len(index), int(index[-1])
    pairs = np.stack([x, np.append(0.0, x[:0:-1])])
    weights = np.array([[1.0], [-1.0]]) / x[0]
    near = np.append(np.diff(index) <= NEAR, False)
    B = np.empty((m, m))
    row, i, k = x[: last + 1], 0, 0  # The entries (i, i), (i, i + 1) … of A⁻¹.
    while k < m:
        if index[k] - i > NEAR:
            i = int(index[k])
            unit = np.zeros((1, n))
            unit[0, i] = 1.0
            row = column.inverse.apply(unit)[0, i : last + 1]
        # The rows from i on, down to the last position that is near to the one before it.
        rows = max(2, PANEL // len(row))
        stop = int(np.searchsorted(index, i + rows))
        if not near[k:stop].all():
            stop = k + int(np.argmin(near[k:stop])) + 1
            rows = int(index[stop - 1]) + 1 - i
        D = (weights * pairs[:, i : i + rows]).T @ pairs[:, i : last + 1]
        D[0] = row
        for above, below in enumerate(D[1:]):
            below[above + 1 :] += D[above, above:-1]
        # No index is clipped, but then they are taken without a buffer, in a fifth of the time.
        D[index[k:stop] - i].take(index[k:] - i, axis=1, out=B[k:stop, k:], mode="clip")
        row, i, k = D[-1, len(D) - 1 :], i + len(D) - 1, stop
    return B
