"""Levels of a multilevel sparse approximate inverse, for a mask that has changed in some places.

Only the rows of G that see a change are computed, and what they belong to on the next level. There
a load, or a diagonal, that is nearly what it was, is left: one cell of the sixteen of an aggregate
changes its load by some per cent, and E⁻¹ need not be more exact than E. A load is always compared
with the one that is in use, so that errors do not add up, one update after the other. Where many
rows would stand beside those that were built for some mask, or be of no use any more, the level is
built anew.
"""

from typing import Any

import numpy as np
from scipy.sparse import vstack

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.aggregates import aggregated, aggregation
from toeplitz_mg.preconditioners.fsai.build import (
    aggregates,
    blocks_of,
    build,
    factor,
    few,
    rows_of,
)
from toeplitz_mg.preconditioners.fsai.levels import AnyLevel, Cells, Direct, Level, Patched, Rows
from toeplitz_mg.preconditioners.fsai.stencil import Stencil

KEPT = 0.1  # loads and diagonals of aggregates may differ from what they are by so much
PART = 0.4  # of the rows: where more would be new, or of no use any more, all are new


def update(stencil: Stencil, cells: Cells, dtype: np.dtype[Any], old: AnyLevel) -> AnyLevel:
    """Return the levels for other cells, from those that there are.

    Parameters
    ----------
    stencil : Stencil
    cells : Cells
    dtype : dtype
        Of what is applied; everything is computed in float64.
    old : Level or Patched or Direct
        Of the same stencil.
    """
    changed = cells.changed_from(old.cells, KEPT)
    if isinstance(old, Patched) and cells.finest:  # it may be nearer to what was built for
        from_base = cells.changed_from(old.base.cells, KEPT)
        if np.count_nonzero(from_base) <= np.count_nonzero(changed):
            old, changed = old.base, from_base
    where = np.flatnonzero(changed)
    if not len(where):
        return old
    cells = cells.where(changed, old.cells)
    # What has changed will be new, or of no use.
    if isinstance(old, Direct) or few(cells) or len(where) > PART * cells.count:
        return build(stencil, cells, dtype)
    old = Patched.of(old) if isinstance(old, Level) else old
    seeing = changed
    size = stencil.grid.size
    felt = _felt(stencil, cells, old.cells, where)
    for a, steps in enumerate(stencil.steps):
        near = (felt[:, None] - steps[1:]).ravel()
        seeing[near[near // size == a]] = True
    at = np.flatnonzero(seeing & cells.contact)

    # New unknowns come last; those that are none any more keep their numbers.
    was, is_now = old.cells.contact.take(where), cells.contact.take(where)
    born, gone = where[~was], where[~is_now]
    n = old.length + len(born)
    number = old.number.copy()
    number[born] = np.arange(old.length, n, dtype=np.int32)
    lines, no_more = number.take(at), number.take(gone)
    still = np.ones(n, bool)
    still[lines] = still[no_more] = False
    still = still.take(old.lines)
    of_no_use = n - cells.count
    if np.count_nonzero(still) + len(lines) + of_no_use > PART * cells.count:
        return build(stencil, cells, dtype)

    own = rows_of(stencil, cells, at)
    rows = _with(old.rows, own, at, cells.finest, lines, n)
    touched = blocks_of(stencil, at) | blocks_of(stencil, gone)
    on_coarse, inverse = aggregated(stencil, cells, rows, touched, old.coarse.cells, KEPT)
    coarse = update(stencil.coarser, on_coarse, dtype, old.coarse)

    G = factor(stencil, cells, own, at, number, n).astype(dtype, copy=False)
    slots = stencil.grid.slots + stencil.grid.origins[touched, None]
    slots = np.concatenate([slots.ravel() + a * size for a in stencil.components])
    again = slots[cells.contact.take(slots)]
    new, places = aggregation(stencil, rows, inverse, again)
    block = np.concatenate([old.block, np.zeros((len(born), places.shape[1]), np.int32)])
    w = np.zeros(block.shape, dtype)
    w[: old.length] = old.W.data.reshape(old.block.shape)
    w[no_more] = 0.0
    again = number.take(again)
    w[again], block[again] = new, places
    W = aggregates(w, coarse.number.take(block), coarse.length)
    if still.any():
        beside = old.G[still]
        beside.resize(beside.shape[0], n)
        G = vstack([beside, G], format="csr")
    gone = np.concatenate([old.gone, no_more])
    lines = np.concatenate([old.lines[still], lines])
    return Patched(old.base, cells, rows, block, number, gone, lines, G, W, coarse)


def _felt(stencil: Stencil, new: Cells, old: Cells, where: Array) -> Array:
    """Return the places in which a change is felt by the unknowns around.

    The rows of G depend on c and d by the correlations c_i T(i-j) c_j / √(d_i d_j).
    """
    if new.finest:
        return where
    zero = np.sqrt(stencil.zero).take(where // stencil.grid.size)
    was, now = (cells.c.take(where) / np.sqrt(cells.d.take(where)) for cells in (old, new))
    return np.asarray(where[np.abs(now - was) * zero > KEPT])


def _with(old: Rows, own: Rows, at: Array, finest: bool, lines: Array, n: int) -> Rows:
    """Return the old rows of G with those of the places `at`, which have the numbers `lines`."""
    place = old.place.copy()
    if finest:
        place[at] = own.place
        return Rows(old.rows, old.sums, place)
    place[at] = lines  # one row for each of n numbers
    rows, sums = np.empty((n, len(old.rows))), np.empty((len(old.sums), n))
    m = old.rows.shape[1]
    rows[:m], sums[:, :m] = old.rows.T, old.sums
    rows[lines], sums[:, lines] = own.rows.T, own.sums
    return Rows(rows.T, sums, place)
