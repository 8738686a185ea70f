"""Build all levels of a multilevel sparse approximate inverse for a mask."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import share, share_slices
from toeplitz_mg.preconditioners.direct import DIRECT
from toeplitz_mg.preconditioners.fsai.aggregates import Rows, aggregate, prolong
from toeplitz_mg.preconditioners.fsai.levels import (
    BLOCK,
    Direct,
    Level,
    LevelMatrix,
    cut_rows,
    number_places,
)
from toeplitz_mg.preconditioners.fsai.rows import CHUNK, solve_rows
from toeplitz_mg.preconditioners.fsai.stencil import Stencil


@dataclass(frozen=True)
class Options:
    """The parameters of a multilevel sparse approximate inverse, except its precision.

    Attributes
    ----------
    neighbours : int, optional
        The number of preceding cells that a row of G uses. By default a trial finds how many the
        kernel needs.
    direct : int
        Most unknowns that a Cholesky factor solves for.
    direct_on_line : int
        The same for a whole line, whose levels cost very little.
    is_line_alike : bool
        Whether to exploit that all rows of G on a whole line are equal.
    """

    neighbours: int | None = None
    direct: int = DIRECT
    direct_on_line: int = 128
    is_line_alike: bool = True


DEFAULT = Options()


def build(
    stencil: Stencil, matrix: LevelMatrix, dtype: np.dtype[Any], options: Options = DEFAULT
) -> Level | Direct:
    """Build a level and those below it.

    Parameters
    ----------
    stencil : Stencil
        The neighbours, and what else depends only on the kernel.
    matrix : LevelMatrix
    dtype : dtype
        The precision in which the levels are applied; they are computed in float64.
    options : Options
    """
    at = np.flatnonzero(matrix.active)
    if len(at) <= options.direct:
        return Direct.of(_dense(stencil, matrix, at), dtype)
    G, W, E = build_factors(stencil, stencil.coarser, matrix, at, dtype)
    return Level(G, W, build(stencil.coarser, E, dtype, options))


def build_factors(
    stencil: Stencil, coarser: Stencil, matrix: LevelMatrix, at: Array, dtype: np.dtype[Any]
) -> tuple[list[csr_array], list[csr_array], LevelMatrix]:
    """Return the rows of G and W for the unknowns at these places, in blocks, and E.

    The columns of G are all unknowns. Those of W are the unknowns of E: the aggregates, numbered as
    cells of `coarser`, that contain some of these places.
    """
    rows = compute_rows(stencil, matrix, at)
    E, inverse = aggregate(stencil, coarser, matrix, rows, at)
    counts = matrix.count, E.count
    blocks = cut_rows(len(at), len(stencil.steps[0]))
    G, W = ([csr_array((0, 0))] * len(blocks) for _ in range(2))

    def work(some: range) -> None:
        for k in some:
            own = at[blocks[k]]
            g = assemble_factor(stencil, matrix, rows, own, blocks[k])
            w, columns = prolong(stencil, coarser, rows, inverse, own)
            columns = E.number.take(columns)
            starts = np.arange(0, w.size + 1, w.shape[1], dtype=np.int32)
            parts = (g.data, g.indices, g.indptr), (w.ravel(), columns.ravel(), starts)
            for F, (data, *places), m in zip((G, W), parts, counts, strict=True):
                F[k] = csr_array((data.astype(dtype, copy=False), *places), (len(own), m))

    share(work, len(blocks), len(at) * len(stencil.steps[0]))
    return G, W, E


def compute_rows(stencil: Stencil, matrix: LevelMatrix, at: Array) -> Rows:
    """Return the rows of G for the unknowns at these places."""
    parts, entries = stencil.split(at), len(stencil.steps[0])
    if matrix.by_table:
        place = np.zeros(len(matrix.c), np.int16)
        for a, part in enumerate(parts):

            def find(some: slice, a: int = a, part: Array = part) -> None:
                pattern = _find_patterns(stencil.steps[a], matrix.active, part[some])
                place[part[some]] = pattern + np.int16(a * stencil.patterns)

            share_slices(find, len(part), BLOCK, len(part) * entries)
        return Rows(stencil.table, stencil.table_sums, place)
    rows, sums = np.empty((len(at), entries)), np.empty((len(parts), len(at)))
    start = 0
    for a, places in enumerate(parts):

        def compute(some: slice, a: int = a, places: Array = places, start: int = start) -> None:
            near = stencil.steps[a][:, None] + places[some]
            c = matrix.c.take(near)
            found = solve_rows(stencil.near[a], c, matrix.d.take(near))
            own = slice(start + some.start, start + some.stop)
            rows[own], sums[:, own] = found.T, stencil.sums(found, c)

        share_slices(compute, len(places), 2 * CHUNK, len(places) * entries**2)
        start += len(places)
    return Rows(rows.T, sums, number_places(at, len(matrix.c)))


def _find_patterns(steps: Array, active: Array, at: Array) -> Array:
    """Return for each of these ascending places which neighbours are active, as bits."""
    if not len(at):
        return np.zeros(0, np.int16)
    start, stop = at[0], at[-1] + 1
    if len(steps) * len(at) < stop - start:
        bits = np.int16(1) << np.arange(len(steps) - 1, dtype=np.int16)
        return bits @ active.take(steps[1:, None] + at)
    pattern = np.zeros(stop - start, np.int16)
    for step in steps[:0:-1].tolist():
        pattern += pattern
        pattern |= active[start + step : stop + step]
    return pattern.take(at - start)


def assemble_factor(
    stencil: Stencil, matrix: LevelMatrix, rows: Rows, at: Array, own: slice
) -> csr_array:
    """Return the rows of G for the unknowns at these places, in float64.

    Parameters
    ----------
    stencil : Stencil
    matrix : LevelMatrix
    rows : Rows
    at : ndarray of int
    own : slice
        The slice of these places among those of all unknowns in `rows`.
    """
    parts = stencil.split(at)
    if matrix.by_table:
        G = stencil.sparse_table[rows.place.take(at)]
    else:
        G = stencil.compress(rows.rows[:, own], [len(part) for part in parts])
    # The first place that each row may use.
    lowest = [part + steps.min() for part, steps in zip(parts, stencil.steps, strict=True)]
    first = np.concatenate(lowest).astype(np.int32)
    G.indices += np.repeat(first, np.diff(G.indptr))
    matrix.number.take(G.indices, out=G.indices, mode="clip")
    return G


def _dense(stencil: Stencil, matrix: LevelMatrix, at: Array) -> Array:
    E = stencil.matrix(at)
    c = matrix.c[at]
    E *= c
    E *= c[:, None]
    np.fill_diagonal(E, matrix.d[at])
    return E
