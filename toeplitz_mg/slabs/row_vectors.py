"""Inner products of fields by rows: bitwise equal for any distribution of the rows over ranks.

The inner products of the rows are added exactly and rounded once. So the order does not matter, and
several ranks find the same result as one that has all rows.
"""

from math import fsum, prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import PIECE, WORTH_THREADS, share, share_slices
from toeplitz_mg.engine.vectors import PART, Gather, Vectors
from toeplitz_mg.engine.workspace import workspace

SHORT = 32  # Shortest row for which it pays to sum rows first, and then their sums exactly.

# The number of unknowns in each row of a field, or, if it varies, the first unknown of each row;
# None for a field without rows or with short ones.
RowsOf = int | Array | None


def rows_of(shape: tuple[int, ...], mask: Array | None = None) -> RowsOf:
    """Return the rows of a field of this shape, or of its unknowns: pieces of its last axis.

    For a distributed field `shape` is that of the whole, and `mask` that of this rank's part.
    """
    n = int(shape[-1])
    # A row that is too long for one part is cut into pieces of equal length.
    count = next((k for k in range(-(-n // PART), n // SHORT + 1) if n % k == 0), 0)
    if prod(shape[:-1]) <= 1 or not count:
        return None
    if mask is None:
        return n // count
    lengths = np.count_nonzero(mask.reshape(-1, n // count), axis=1)
    return (np.cumsum(lengths) - lengths)[lengths > 0]


class RowVectors(Vectors):
    """Operations with real vectors distributed by rows (see `engine.vectors`).

    Parameters
    ----------
    gather : callable
        Returns the numbers or arrays of all ranks, in the same order on each.
    rows : int or ndarray of int
        The result of `rows_of` for the vectors.
    """

    def __init__(self, gather: Gather, rows: RowsOf) -> None:
        super().__init__(gather)

        def dot(x: Array, y: Array) -> float:
            sums = row_dots(x, y, rows).tolist()
            total = add_exactly(sums)
            # Send the rounding error too; together both numbers are nearly exact.
            both = np.array([total, add_exactly([*sums, -total])])
            return add_exactly(np.ravel(gather(both)).tolist())

        self.dot = dot


def row_dots(x: Array, y: Array, rows: Any) -> Array:
    """Return the inner products of the rows of two real vectors.

    Each is bitwise independent of the other rows and of threads. So their exact sum, rounded once,
    does not depend on the distribution of the rows over processes.
    """
    if type(rows) is int:
        X, Y = x.reshape(-1, rows), y.reshape(-1, rows)
        return np.vecdot(X, Y) if x.size < WORTH_THREADS else _share_dots(X, Y)
    if x.size <= PIECE:
        return np.add.reduceat(x * y, rows)
    sums = np.empty(len(rows), np.result_type(x, y))

    def work(part: slice) -> None:
        start = int(rows[part.start])
        stop = int(rows[part.stop]) if part.stop < len(rows) else x.size
        product = workspace((stop - start,), sums.dtype)
        np.multiply(x[start:stop], y[start:stop], out=product)
        np.add.reduceat(product, rows[part] - start, out=sums[part])

    share_slices(work, len(rows), max(1, PIECE * len(rows) // x.size), x.size)
    return sums


def _share_dots(X: Array, Y: Array) -> Array:
    sums = np.empty(len(X), np.result_type(X, Y))

    def work(rows: range) -> None:
        some = slice(rows.start, rows.stop)
        np.vecdot(X[some], Y[some], out=sums[some])

    share(work, len(X), X.size)
    return sums


def add_exactly(numbers: list[float]) -> float:
    """Return the sum of numbers, rounded once, in any order."""
    try:
        return fsum(numbers)
    except (OverflowError, ValueError):  # Numbers or their sum are not finite.
        return float(np.sum(numbers))
