"""A rectangle around the elements in contact, of which ranks have other rows than of the grid."""

from dataclasses import replace
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.window import Box
from toeplitz_mg.slabs.intervals import Intervals, of_rows
from toeplitz_mg.slabs.slab import Slab

FEW = 2**13  # Most elements of a grid within this one that every rank has all of, and solves alone.


class SlabWindow:
    """A rectangle of elements of a grid in slabs (see `contact.window.Window`).

    Parameters
    ----------
    whole : SlabGrid
        The grid.
    box : tuple of slice
        The elements along each axis.

    Attributes
    ----------
    grid : SlabGrid or Grid
        That of the elements inside, cut anew; where every rank has all of it a `Grid`.
    """

    def __init__(self, whole: Any, box: Box) -> None:
        self.whole, self.box, slab = whole, box, whole.slab
        begin, end, ranks = box[0].start, box[0].stop, slab.comm.size
        shape = end - begin, box[1].stop - box[1].start
        is_cut = shape[0] * shape[1] > FEW
        if is_cut and shape[0] < ranks:  # Each rank has a row.
            begin = min(begin, whole.shape[0] - ranks)
            end, shape = begin + ranks, (ranks, shape[1])
            self.box = slice(begin, end), box[1]
        self.grid: Any = replace(whole.whole, shape=shape)
        first, stop = np.full(ranks, begin), np.full(ranks, end)
        bounds = np.clip(slab.starts, begin, end)
        self._rows = slice(*bounds[slab.comm.rank : slab.comm.rank + 2].tolist())
        self._back: Intervals | None = None
        if is_cut:
            self.grid = replace(whole, shape=shape, slab=Slab(slab.comm, shape))
            first, stop = begin + self.grid.slab.starts[:-1], begin + self.grid.slab.starts[1:]
            self._back = Intervals(slab, np.append(first, end), bounds[:-1], bounds[1:])
        self._there = Intervals(slab, slab.starts, first, stop)

    def cut(self, x: Array) -> Array:
        """Return this rank's rows of a field, of any components, inside."""
        return of_rows(self._there.spread, x[..., self.box[1]])

    def same(self, found: Any) -> Any:
        """Return what was found inside: where every rank has solved alone, by the first.

        Processors of different kinds round differently, and take other numbers of iterations.
        """
        return self.whole.slab.of_first(found) if self._back is None else found

    def extend(self, x: Array) -> Array:
        """Return this rank's rows of a field on the whole grid that is zero outside."""
        slab, (own, columns) = self.whole.slab, (self._rows, self.box[1])
        if self._back is None:
            x = x[..., own.start - self.box[0].start : own.stop - self.box[0].start, :]
        else:
            x = of_rows(self._back.spread, x)
        whole = np.zeros((*x.shape[:-2], *slab.local), x.dtype)
        rows = slice(own.start - slab.rows.start, own.stop - slab.rows.start)
        whole[..., rows, columns] = x
        return whole
