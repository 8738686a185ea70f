"""Levels of a multilevel sparse approximate inverse, for a mask that has changed in some places.

Only the rows of G that see a change are computed, and what they belong to on the next level. There
a load, or a diagonal, that is nearly what it was, is left: one cell of the sixteen of an aggregate
changes its load by some per cent, and E⁻¹ need not be more exact than E. The changes are always
those from the mask that was built for, so that errors do not add up, one update after the other,
and where too much has changed the level is built anew.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toeplitz_mg.preconditioners.fsai_apply import AnyLevel, Cells, Level, Patched, Rows
from toeplitz_mg.preconditioners.fsai_levels import (
    aggregated,
    aggregation,
    build,
    factor,
    few,
    one_each,
    rows_of,
)
from toeplitz_mg.preconditioners.fsai_table import Stencil

Array = NDArray[Any]

KEPT = 0.1  # loads and diagonals of aggregates may differ from what they are by so much
PART = 0.4  # of the rows: where more would be new, all are


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
    base = old.base if isinstance(old, Patched) else old
    changed = cells.changed_from(base.cells, KEPT)
    where = np.flatnonzero(changed)
    if not len(where):
        return base
    if not isinstance(base, Level) or few(cells):
        return build(stencil, cells, dtype)
    cells = cells.where(changed, base.cells)
    seeing = changed
    near = (_felt(stencil, cells, base.cells, where)[:, None] - stencil.steps[1:]).ravel()
    seeing[near[near < len(seeing)]] = True
    at = np.flatnonzero(seeing & cells.contact)
    if len(at) > PART * cells.count:
        return build(stencil, cells, dtype)

    # New unknowns come last; those that are none any more keep their numbers.
    was, is_now = base.cells.contact.take(where), cells.contact.take(where)
    born, gone = where[~was], where[~is_now]
    n = base.length + len(born)
    number = base.number.copy()
    number[born] = np.arange(base.length, n, dtype=np.int32)

    rows = _rows(stencil, cells, at, base.rows)
    touched = np.zeros(len(stencil.origins), bool)
    touched[stencil.block_of.take(np.concatenate([at, gone]))] = True
    on_coarse = aggregated(stencil, cells, rows, touched, base.coarse.cells, KEPT)
    coarse = update(stencil.coarser, on_coarse, dtype, base.coarse)

    G = factor(stencil, cells, rows, at, number, n).astype(dtype, copy=False)
    gone = number.take(gone)
    slots = stencil.slots + stencil.origins[touched, None]
    again = slots[cells.contact.take(slots)]
    w = np.concatenate([base.W.data, np.zeros(len(born), dtype)])
    w[gone] = 0.0
    w[number.take(again)] = aggregation(
        stencil, rows, on_coarse, again, stencil.aggregate_of(again)
    )
    block = np.concatenate([base.block, stencil.aggregate_of(born)])
    W = one_each(w, coarse.number.take(block), coarse.length)
    return Patched(base, cells, number, gone, number.take(at), G, W, coarse)


def _felt(stencil: Stencil, new: Cells, old: Cells, where: Array) -> Array:
    """Return the places in which a change is felt by the unknowns around.

    The rows of G depend on c and d by the correlations c_i T(i-j) c_j / √(d_i d_j).
    """
    if new.finest:
        return where
    was, now = (cells.c.take(where) / np.sqrt(cells.d.take(where)) for cells in (old, new))
    return np.asarray(where[np.abs(now - was) * np.sqrt(stencil.T[0, 0]) > KEPT])


def _rows(stencil: Stencil, cells: Cells, at: Array, old: Rows) -> Rows:
    """Return the old rows of G with those of the cells `at`."""
    rows, sums, index = rows_of(stencil, cells, at)
    place = old.place.copy()
    if cells.finest:
        place[at] = index
        return Rows(rows, sums, place)
    place[at] = index + len(old.sums)
    known = np.concatenate([old.rows.T, rows.T]).T
    return Rows(known, np.concatenate([old.sums, sums]), place)
