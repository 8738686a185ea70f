"""The multilevel sparse approximate inverse on slabs.

Each rank builds the rows of G and W for its unknowns with the functions of the serial package. It
needs the near coefficients, the unknowns in its rows, and those in as many rows above as a row of G
reaches. Nothing else is needed, because each aggregate belongs to one rank: on each level the cuts
between ranks are rounded to whole aggregates, which moves only a few rows. So an application
exchanges a few rows per rank and level in each direction, and needs no transforms.

The aggregates are the next level, with the same cuts. Each level has 16 times fewer unknowns, so
soon all ranks can store a whole level and apply it identically.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.preconditioners.fsai.build import Options, build, build_factors
from toeplitz_mg.preconditioners.fsai.levels import Direct, Level, LevelMatrix
from toeplitz_mg.preconditioners.fsai.line import LineLevel, LineMatrix, build_line
from toeplitz_mg.preconditioners.fsai.stencil import Stencil
from toeplitz_mg.slabs.intervals import Intervals, of_rows
from toeplitz_mg.slabs.slab import Slab

NEAR = 256  # Near lags along each axis: enough for a stencil with 100 neighbours.
TRIAL = 2**14  # Cells of the largest grid on which the number of neighbours is tried.


@dataclass(frozen=True)
class SlabMatrix:
    """A rank's part of the matrix of a level.

    Attributes
    ----------
    slab : Slab
    starts : ndarray of int, shape (P + 1,)
        The first row of each rank, and the number of rows.
    stencil : Stencil
        The stencil of the near coefficients.
    kernel : ndarray of shape (d, d, rows, n2)
        This rank's rows of the coefficients.
    c, d : ndarray of shape (d, rows, n2)
        The weights and the diagonal of the cells in these rows; for A itself a mask and None.
    """

    slab: Slab
    starts: Array
    stencil: Stencil
    kernel: Array
    c: Array
    d: Array | None = None

    def count_unknowns(self) -> Array:
        """Return the number of unknowns above each row in each component, shape (d, n1 + 1)."""
        counts = self.slab.everywhere(np.count_nonzero(self.c, axis=2).T, np.diff(self.starts))
        return np.pad(np.cumsum(counts, axis=0), ((1, 0), (0, 0))).T

    def on_places(self, stencil: Stencil, exchange: Callable[[Array], Array]) -> LevelMatrix:
        """Return the matrix on the places of a stencil, for the rows that `exchange` returns."""
        c, place = of_rows(exchange, self.c), stencil.grid.place
        if self.d is None:
            return LevelMatrix.of_mask(stencil, c)
        d = of_rows(exchange, self.d)
        weights, diagonal = ([place(x, edge) for x in X] for X, edge in ((c, 0.0), (d, 1.0)))
        return LevelMatrix(np.concatenate(weights), np.concatenate(diagonal))


def find_near(slab: Slab, starts: Array, kernel: Array) -> Array:
    """Return the near coefficients, the same on all ranks."""
    n1, n2 = int(starts[-1]), kernel.shape[3]
    rows, columns = max(NEAR, TRIAL // n2), max(NEAR, TRIAL // n1)
    counts = np.diff(np.minimum(starts, rows))
    mine = kernel[:, :, : counts[slab.comm.rank], :columns]
    return of_rows(lambda x: slab.everywhere(x, counts), mine)


@dataclass(frozen=True)
class SlabLevel:
    """A level with the rows of G and W distributed over the ranks.

    Attributes
    ----------
    intervals : tuple of Intervals
        For each component the unknowns that the rows of G use.
    level : Level
        The columns of its G are these unknowns.
    """

    intervals: tuple[Intervals, ...]
    level: Level

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level, all ranks together."""
        return (sum(w.total for w in self.intervals), *self.level.coarse.sizes)

    def __call__(self, x: Array, out: Array | None = None) -> Array:
        """Apply the inverse to this rank's part of a vector, into `out`, which may be `x`."""
        out = np.empty_like(x) if out is None else out
        z = workspace((sum(w.seen for w in self.intervals),), x.dtype)
        for w, own, seen in self._parts(x, z):
            w.spread(own, seen)
        # A rank may have more rows of G than it owns, to complete its aggregates.
        rows = self.level.G.shape[0]
        self.level(z, z, out[:rows] if rows <= len(out) else None)
        for w, own, seen in self._parts(out, z):
            own[...] = w.collect(seen)
        return out

    def _parts(self, x: Array, z: Array) -> Iterator[tuple[Intervals, Array, Array]]:
        """Yield for each component the owned part of a vector, and the part that G uses."""
        own, seen = ([getattr(w, name) for w in self.intervals] for name in ("owned", "seen"))
        return zip(self.intervals, _split(x, own), _split(z, seen), strict=True)


@dataclass(frozen=True)
class CommonLevel:
    """A level that all ranks store and apply identically.

    Attributes
    ----------
    slab : Slab
    counts : ndarray of int, shape (d, P)
        The number of unknowns of each rank, in each component.
    level : Level, LineLevel or Direct
    """

    slab: Slab
    counts: Array
    level: Level | LineLevel | Direct

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return self.level.sizes

    def __call__(self, x: Array, out: Array | None = None) -> Array:
        """Apply the inverse to this rank's part of a vector, into `out`, which may be `x`."""
        out = np.empty_like(x) if out is None else out
        rank = self.slab.comm.rank
        parts = _split(x, self.counts[:, rank])
        whole = [self.slab.everywhere(x, n) for x, n in zip(parts, self.counts, strict=True)]
        parts = _split(self.level(_join(whole)), self.counts.sum(axis=1))
        ends = np.cumsum(self.counts, axis=1)[:, rank]
        for y, own, end in zip(parts, _split(out, self.counts[:, rank]), ends, strict=True):
            own[...] = y[end - len(own) : end]
        return out


def build_on_slab(
    matrix: SlabMatrix, options: Options, dtype: np.dtype[Any], most: float
) -> SlabLevel | CommonLevel:
    """Build a level and those below it; levels with at most `most` cells are built on all ranks."""
    slab, starts, stencil = matrix.slab, matrix.starts, matrix.stencil
    ends = matrix.count_unknowns()
    rank, n1, (d, _, n2) = slab.comm.rank, int(starts[-1]), matrix.c.shape
    counts = np.diff(ends[:, starts], axis=1)
    if slab.comm.size > 1 and counts.sum() <= options.direct:
        return CommonLevel(slab, counts, _direct(matrix, counts, dtype))
    if slab.comm.size == 1 or n1 * n2 <= most:
        with slab.agree():
            if slab.comm.size == 1 and 1 in (n1, n2) and counts.tolist() == [[n1 * n2]]:
                line = LineMatrix.of_kernel(matrix.kernel.ravel())
                return CommonLevel(slab, counts, build_line(line, dtype, options))
            exchange = partial(slab.everywhere, lengths=np.diff(starts))
            whole = replace(stencil, kernel=of_rows(exchange, matrix.kernel))
            level = build(whole, matrix.on_places(whole, exchange), dtype, options)
        return CommonLevel(slab, counts, level)
    # On this level a rank has the rows of whole aggregates. Rows of G use p rows above them.
    h, p = stencil.grid.block[0], stencil.grid.reach[0]
    cuts = np.append(np.minimum((starts[:-1] + h // 2) // h * h, n1), n1)
    first = _begin(cuts[:-1] - p, cuts)
    stencil = replace(stencil, part=(int(cuts[rank + 1] - cuts[rank]), n2))
    seen = matrix.on_places(stencil, Intervals(slab, starts, first, cuts[1:]).spread)
    own = seen.active.copy().reshape(d, -1)
    own[:, : p * stencil.grid.padded[1]] = False
    coarser = _coarsen(matrix, stencil, cuts)
    with slab.agree():
        G, W, E = build_factors(stencil, coarser.stencil, seen, np.flatnonzero(own), dtype)
    inside, shape = coarser.stencil.grid.inside, coarser.c.shape
    c, e = (x.reshape(d, -1).take(inside, axis=1).reshape(shape) for x in (E.c, E.d))
    intervals = tuple(Intervals(slab, end[starts], end[first], end[cuts[1:]]) for end in ends)
    coarser = replace(coarser, stencil=replace(coarser.stencil, part=None), c=c, d=e)
    del seen, own, E, c, e
    return SlabLevel(intervals, Level(G, W, build_on_slab(coarser, options, dtype, most)))


def _coarsen(matrix: SlabMatrix, stencil: Stencil, cuts: Array) -> SlabMatrix:
    """Return the next level, with the coefficients and the stencil of this rank's aggregates."""
    slab, rank, n1, h = matrix.slab, matrix.slab.comm.rank, int(cuts[-1]), stencil.grid.block[0]
    starts = -(-cuts // h)
    stops = np.minimum(h * starts, n1)
    first = _begin(h * starts[:-1] - h + 1, stops)
    kernel = of_rows(Intervals(slab, matrix.starts, first, stops[1:]).spread, matrix.kernel)
    blocks = range(int(starts[rank]), int(starts[rank + 1]))
    kernel = stencil.coarsen(kernel, blocks, int(first[rank]), n1)
    near, neighbours = find_near(slab, starts, kernel), stencil.coarse_neighbours
    coarser = Stencil(near, neighbours, neighbours, (len(blocks), kernel.shape[3]))
    return SlabMatrix(slab, starts, coarser, kernel, kernel[0])


def _direct(matrix: SlabMatrix, counts: Array, dtype: np.dtype[Any]) -> Direct:
    """Return the inverse of the matrix, assembled from the coefficients of all ranks."""
    slab, starts = matrix.slab, matrix.starts
    component, i, j = np.nonzero(matrix.c)
    c = matrix.c[component, i, j].astype(float)
    d = matrix.stencil.zero[component] if matrix.d is None else matrix.d[component, i, j]
    mine = np.stack([i + starts[slab.comm.rank], j, c, d], axis=1)
    parts = _split(mine, counts[:, slab.comm.rank])
    whole = [slab.everywhere(x, n) for x, n in zip(parts, counts, strict=True)]
    component = np.repeat(np.arange(len(counts)), counts.sum(axis=1))
    i, j, c, d = np.concatenate(whole).T
    step_i, step_j = (x.astype(int)[:, None] - x.astype(int) for x in (i, j))
    # Each rank computes the entries for which it has the coefficients.
    owner = starts[1:].searchsorted(np.abs(step_i).ravel(), side="right")
    order, of_rank = np.argsort(owner, kind="stable"), np.bincount(owner, minlength=slab.comm.size)
    end = of_rank[: slab.comm.rank + 1].sum()
    row, column = np.divmod(order[end - of_rank[slab.comm.rank] : end], len(c))
    a, b = component[row], component[column]
    lag = np.abs(step_i[row, column]) - starts[slab.comm.rank], np.abs(step_j[row, column])
    E = np.empty(owner.size)
    E[order] = slab.everywhere(matrix.kernel[a, b, *lag], of_rank)
    E = E.reshape(len(c), len(c))
    between = component[:, None] != component
    E[between] *= (np.sign(step_i) * np.sign(step_j))[between]
    E *= c
    E *= c[:, None]
    np.fill_diagonal(E, d)
    with slab.agree():
        return Direct.of(E, dtype)


def _begin(first: Array, cuts: Array) -> Array:
    """Return the first row of each rank's window, within the grid; empty for ranks without rows."""
    return np.where(cuts[1:] > cuts[:-1], np.maximum(first, 0), cuts[1:])


def _split(x: Array, counts: Any) -> list[Array]:
    """Return the part of each component."""
    return np.split(x, np.cumsum(counts)[:-1])


def _join(parts: list[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
