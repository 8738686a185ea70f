"""A grid of elements in slabs, with the matrices that the algorithms of `contact` need."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property, partial
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.contact.coarsening import coarsen, refine
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.window import Box, box_around, ends_of
from toeplitz_mg.halfspace.influence import KERNELS
from toeplitz_mg.halfspace.matrices import evaluate
from toeplitz_mg.preconditioners.causal import ShiftedInverses
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS
from toeplitz_mg.slabs.circulants import SlabTransform
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.fsai import fsai_preconditioner
from toeplitz_mg.slabs.intervals import Intervals, of_rows
from toeplitz_mg.slabs.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.slabs.slab import Slab
from toeplitz_mg.slabs.trigonometric import cosine_preconditioner

FEW = 2**13  # Most elements of a coarse grid or window that every rank stores and solves.
BLOCK = 64  # Rows whose coefficients are evaluated at once, which bounds the memory.


@dataclass(frozen=True)
class SlabGrid(Grid):
    """A grid whose rows are distributed as in a slab; fields have the rows of this rank.

    Attributes
    ----------
    slab : Slab
        Has two axes.
    """

    slab: Any = None
    callers = 2

    @classmethod
    def of_rows(cls, whole: Grid, slab: Slab) -> Self:
        """Return the distributed version of a grid."""
        return cls(**vars(whole), slab=slab)

    def __reduce__(self) -> Any:
        """Pickle as the whole grid: a loaded result then computes its fields in one process."""
        return copy, (self.whole,)

    def agree(self, read: Callable[..., Any], *arguments: Any) -> Any:
        """Return `read(*arguments)`; raise an error unless it is the same on all ranks."""
        with self.slab.agree() as same:
            asked = read(*arguments)
            same.update(_describe(asked))
        return asked

    @property
    def whole(self) -> Grid:
        """The same grid for one process."""
        return Grid(*(getattr(self, part.name) for part in fields(Grid)))

    @property
    def vectors(self) -> Any:
        """The inner products, sums and extremes of fields."""
        return self.slab.vectors

    @property
    def is_small(self) -> bool:
        """False: nothing is cached, because ranks without it would wait for the others."""
        return False

    @property
    def is_line(self) -> bool:
        """False: strips of one element are solved like any surface."""
        return False

    @cached_property
    def _coarser(self) -> Any:
        whole = self.whole.coarser()
        if whole is None or prod(whole.shape) <= FEW:
            return whole  # Every rank stores it as a whole.
        if np.diff(self._coarse_starts).min() == 0:
            return None
        return self.of_rows(whole, self.slab.alike(whole.shape, self._coarse_starts))

    @property
    def _coarse_starts(self) -> Array:
        """The first coarse row of each rank, which has the first of the two averaged rows."""
        return -(-self.slab.starts // 2)

    def centres(self) -> tuple[Array, Array]:
        """Return the centres of this rank's elements along each axis."""
        x, y = super().centres()
        return x[self.slab.rows], y

    def coarser(self, coarsest: int | None = None) -> Any:
        """Return the grid of elements of twice the size, or None if it would be too coarse."""
        if max(self.shape) <= self.coarsest:  # Every rank stores it as a whole.
            return self.whole.coarser(coarsest)
        return self._coarser

    def coarsen(self, x: Array) -> Array:
        """Return the averages of a field on the coarser grid."""
        starts = self._coarse_starts
        x = coarsen(self._see(self.slab, x, 2 * starts[:-1], 2 * starts[1:]))
        if isinstance(self._coarser, SlabGrid):
            return x
        return of_rows(partial(self.slab.everywhere, lengths=np.diff(starts)), x)

    def refine(self, x: Array) -> Array:
        """Interpolate a field from the coarser grid."""
        starts, rank = self._coarse_starts, self.slab.comm.rank
        first = np.maximum(0, starts[:-1] - 1)
        if isinstance(self._coarser, SlabGrid):
            x = self._see(self._coarser.slab, x, first, starts[1:] + 1)
        else:
            x = x[..., first[rank] : starts[rank + 1] + 1, :]
        fine = refine(x, (min(2 * x.shape[-2], self.shape[0]), self.shape[1]))
        start, end = self.slab.rows.start - 2 * first[rank], self.slab.rows.stop - 2 * first[rank]
        return np.ascontiguousarray(fine[..., start:end, :])

    def _see(self, slab: Slab, x: Array, first: Array, stop: Array) -> Array:
        """Return for each rank the rows of a field from `first` to `stop`, at most to the end."""
        rows = Intervals(slab, slab.starts, first, np.minimum(stop, slab.shape[0]))
        return of_rows(rows.spread, x)

    def window(self, elements: Mask, margin: float = 0.0) -> Any:
        """Return the window around some elements plus a margin; the grid if there are none."""
        (first, end), columns = (ends_of(elements, axis) for axis in range(2))
        start, n = self.slab.rows.start, self.shape[0]
        own = (start + first, start + end) if first < end else (n, 0)
        told = np.array(self.vectors.gather(np.array([own, columns])))
        ends = zip(
            told[..., 0].min(axis=0).tolist(), told[..., 1].max(axis=0).tolist(), strict=True
        )
        return SlabWindow(self, box_around(self, ends, margin))

    def lines(self, x: Array, axis: int) -> Array:
        """Return lines of a field along an axis as rows, distributed over the ranks."""
        if axis == 1:
            return x
        ((_, turn),) = self.slab.turns(x.shape[1], x.shape[1])
        return self.slab.to_columns(x, turn).T

    def fragmentation(self, C: Mask) -> float:
        """Return the `traits.fragmentation` of some elements."""
        slab, n = self.slab, self.shape[0]
        # The next rank counts the edges below this rank's last row.
        rows = self._see(slab, C, np.maximum(slab.starts[:-1] - 1, 0), slab.starts[1:])
        ends = slab.rows.start == 0, slab.rows.stop == n
        rows, columns = np.pad(rows, (ends, (0, 0))), np.pad(C, ((0, 0), (1, 1)))
        own = np.count_nonzero(np.diff(rows, axis=0)) + np.count_nonzero(np.diff(columns))
        return float(sum(self.vectors.gather(own)) / self.vectors.count(C) ** 0.5)

    def scaled_normal(self) -> tuple[ToeplitzOperator, float]:  # type: ignore[override]
        """Return the matrix of normal contact divided by its diagonal entry, and that entry."""
        c = self._evaluate("zz", {0: 1.0})
        unit = float(self.vectors.gather(c[0, 0])[0])
        c /= unit
        return ToeplitzOperator(c, self.slab), unit

    def steady(self, A: Any) -> CoupledOperator:
        """Return the matrix of steady rolling."""
        return self._sum({0: 1.0, 1: -1.0})

    def _matrix(self, ahead: int) -> CoupledOperator:
        return self._sum({ahead: 1.0})

    def invert_shifted(
        self, K: CoupledOperator, dtype: DTypeLike, own: Any = ()
    ) -> ShiftedInverses:
        """Return approximate inverses of the matrix of steady rolling plus diagonal matrices."""
        return ShiftedInverses.of(K, SlabTransform(self.slab, dtype))

    def invert_on_runs(self, C: Mask, dtype: DTypeLike) -> tuple[()]:
        """Return no inverses, because a run of elements may extend over several ranks."""
        return ()

    def restrict(self, A: Any, C: Mask) -> MaskedOperator:
        """Return the rows and columns of some elements of a matrix of this grid."""
        return MaskedOperator(A, C)

    def _sum(self, weights: dict[int, float]) -> CoupledOperator:
        """Return the weighted sum of displacement matrices, by the number of elements ahead."""
        xx, xy, yy = (self._block(name, weights) for name in ("xx", "xy", "yy"))
        return CoupledOperator([[xx, xy], [xy, yy]])

    def _block(self, name: str, weights: dict[int, float]) -> ToeplitzOperator | None:
        """Return the block of a matrix for two directions, or None if it is zero."""
        c, behind, parity = self._evaluate(name, weights), None, KERNELS[name].parity
        if any(weights):
            behind, parity = self._evaluate(name, weights, -1.0), (1, parity[1])
        if not self.vectors.count(c) and (behind is None or not self.vectors.count(behind)):
            return None
        return ToeplitzOperator(c, self.slab, parity=parity, behind=behind)

    def _evaluate(self, name: str, weights: dict[int, float], sign: float = 1.0) -> Array:
        """Return this rank's rows of the coefficients, for lags of this sign along x."""
        x, y = self.slab.offsets((self.element[0], self.element[1]))
        c = np.zeros(self.slab.local)
        for k in range(0, len(x), BLOCK):
            for ahead, weight in weights.items():
                at = sign * x[k : k + BLOCK] + ahead * self.element[0]
                c[k : k + BLOCK] += weight * evaluate(name, at, y, self.element, self.material)
        return c

    def invert_by_transform(self, A: Any, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix of this grid."""
        return cosine_preconditioner(A, dtype=dtype)

    def invert_by_fsai(self, A: Any, C: Mask, dtype: DTypeLike | None = None) -> Any:
        """Return an approximate inverse of a matrix of this grid on some elements."""
        return fsai_preconditioner(MaskedOperator(A, C), neighbours=NEIGHBOURS, dtype=dtype)


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
        The grid inside, cut anew into slabs; a `Grid` if every rank stores it as a whole.
    """

    def __init__(self, whole: Any, box: Box) -> None:
        self.whole, self.box, slab = whole, box, whole.slab
        begin, end, ranks = box[0].start, box[0].stop, slab.comm.size
        shape = end - begin, box[1].stop - box[1].start
        is_cut = shape[0] * shape[1] > FEW
        if is_cut and shape[0] < ranks:  # Enlarge it, so that each rank has a row.
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
        """Return this rank's rows of a field inside the window, for any number of components."""
        return of_rows(self._there.spread, x[..., self.box[1]])

    def same(self, found: Any) -> Any:
        """Return a result inside the window; that of the first rank if every rank computed it.

        Processors of different types round differently, and need different numbers of iterations.
        """
        return self.whole.slab.of_first(found) if self._back is None else found

    def extend(self, x: Array) -> Array:
        """Return this rank's rows of a field on the whole grid, zero outside the window."""
        slab, (own, columns) = self.whole.slab, (self._rows, self.box[1])
        if self._back is None:
            x = x[..., own.start - self.box[0].start : own.stop - self.box[0].start, :]
        else:
            x = of_rows(self._back.spread, x)
        whole = np.zeros((*x.shape[:-2], *slab.local), x.dtype)
        rows = slice(own.start - slab.rows.start, own.stop - slab.rows.start)
        whole[..., rows, columns] = x
        return whole


def _describe(asked: Any) -> dict[str, Any]:
    """Return what must be equal on all ranks; fields and results only as given or not."""
    told: dict[str, Any] = {}
    for part in fields(asked):
        value = getattr(asked, part.name)
        if is_dataclass(value) and part.compare:
            told |= _describe(value)
        elif part.compare or value is None:
            told[part.name] = value
        else:
            told[part.name] = "given"
    return told
