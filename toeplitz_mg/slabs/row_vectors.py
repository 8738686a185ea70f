"""Inner products of fields by their rows: the same bits, whichever rank has which of the rows.

Those of the rows are added exactly, and rounded once. So it does not matter in what order, and
ranks of which each has some rows find what one finds that has them all.
"""

from math import fsum, prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import PIECE, WORTH_THREADS, share, share_slices
from toeplitz_mg.engine.vectors import AT_ONCE, PART, Gather, Vectors
from toeplitz_mg.engine.workspace import workspace

SHORT = 32  # Numbers of a row from which on it is worth it to add up rows, and then these exactly.

# How many unknowns each row of a field has, or the first unknown of each row where they differ in
# that; None where a field has no rows, or short ones.
RowsOf = int | Array | None


def rows_of(shape: tuple[int, ...], mask: Array | None = None) -> RowsOf:
    """Return the rows of a field of this shape, or of its unknowns: pieces of its last axis.

    Of a field of which a process has a part, `shape` is that of the whole, and `mask` of the part.
    """
    n = int(shape[-1])
    # Pieces of a row that is too long for one part are as long as each other.
    count = next((k for k in range(-(-n // PART), n // SHORT + 1) if n % k == 0), 0)
    if prod(shape[:-1]) <= 1 or not count:
        return None
    if mask is None:
        return n // count
    lengths = np.count_nonzero(mask.reshape(-1, n // count), axis=1)
    return (np.cumsum(lengths) - lengths)[lengths > 0]


class RowVectors(Vectors):
    """Operations with real vectors of which each rank has some rows (see `engine.vectors`).

    Parameters
    ----------
    gather : callable
        Takes a number, or an array, and returns those of all ranks, in the same order on each.
    rows : int or ndarray of int
        `rows_of` the vectors.
    """

    def __init__(self, gather: Gather, rows: RowsOf) -> None:
        super().__init__(gather)

        def dot(x: Array, y: Array) -> float:
            sums = row_dots(x, y, rows).tolist()
            total = add_exactly(sums)
            # What rounding takes from it goes with it: together they are as good as exact.
            both = np.array([total, add_exactly([*sums, -total])])
            return add_exactly(np.ravel(gather(both)).tolist())

        self.dot = dot


def row_dots(x: Array, y: Array, rows: Any) -> Array:
    """Return the inner products of the rows of two real vectors.

    Neither other rows nor threads change the bits of one. The exact sum of all, rounded once, is
    then the same for all processes that have the rows among them, and for one that has them all.
    """
    if type(rows) is int:
        X, Y = x.reshape(-1, rows), y.reshape(-1, rows)
        return np.vecdot(X, Y) if x.size < WORTH_THREADS else _share_dots(X, Y)
    if x.size <= AT_ONCE:
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
    """Return the sum of numbers, rounded once, in whatever order they are."""
    try:
        return fsum(numbers)
    except (OverflowError, ValueError):  # Some are not finite, or their sum is not.
        return float(np.sum(numbers))
