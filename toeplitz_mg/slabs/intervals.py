"""Intervals of a vector that ranks use, while each rank owns another interval."""

from collections.abc import Callable

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.slabs.slab import Slab


class Intervals:
    """Intervals of a vector that ranks use, while each rank owns another interval.

    Parameters
    ----------
    slab : Slab
    owned : ndarray of int, shape (P + 1,)
        The start of the part that each rank owns, and the end.
    first, stop : ndarray of int, shape (P,)
        The interval that each rank uses.
    """

    def __init__(self, slab: Slab, owned: Array, first: Array, stop: Array) -> None:
        rank = slab.comm.rank
        low, high = owned[rank], owned[rank + 1]
        self.slab, self.total = slab, int(owned[-1])
        self.owned, self.seen = int(high - low), int(stop[rank] - first[rank])
        begin = np.maximum(first, low)
        self._lengths = np.maximum(np.minimum(stop, high) - begin, 0)
        self._starts = np.where(self._lengths > 0, begin - low, 0)
        overlap = np.minimum(owned[1:], stop[rank]) - np.maximum(owned[:-1], first[rank])
        self._expected = np.maximum(overlap, 0)
        self._is_own = np.array_equal(first, owned[:-1]) and np.array_equal(stop, owned[1:])

    def spread(self, x: Array, out: Array | None = None) -> Array:
        """Return the interval that this rank uses, from the owned parts; in `out` if given.

        Without `out`, `x` itself is returned if every rank uses just its own part.
        """
        if self._is_own and out is None:
            return x
        return self.slab.exchange(x, self._starts, self._lengths, self._expected, out)

    def collect(self, x: Array) -> Array:
        """Return the transpose of `spread`: for each owned entry the sum over the ranks using it.

        The result may share the memory of `x`, which is changed then.
        """
        if self._is_own:
            return x
        here = self.slab.comm.rank
        is_other = np.arange(len(self._lengths)) != here
        starts = np.cumsum(self._expected) - self._expected
        got = self.slab.exchange(x, starts, self._expected * is_other, self._lengths * is_other)
        total = x[starts[here] : starts[here] + self._expected[here]]
        if len(total) < self.owned:
            part, total = total, np.zeros((self.owned, *x.shape[1:]), x.dtype)
            total[self._starts[here] : self._starts[here] + len(part)] = part
        end = 0
        for rank in np.flatnonzero(self._lengths * is_other):
            start, length = self._starts[rank], self._lengths[rank]
            total[start : start + length] += got[end : end + length]
            end += length
        return total


def of_rows(exchange: Callable[[Array], Array], x: Array) -> Array:
    """Apply an exchange of rows to the last but one axis; return a contiguous array."""
    rows = exchange(np.ascontiguousarray(np.moveaxis(x, -2, 0)))
    return np.ascontiguousarray(np.moveaxis(rows, 0, -2))
