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

from toeplitz_mg.preconditioners.fsai_aggregates import aggregated, aggregation
from toeplitz_mg.preconditioners.fsai_apply import AnyLevel, Cells, Level, Patched, Rows
from toeplitz_mg.preconditioners.fsai_levels import (
    aggregates,
    blocks_of,
    build,
    factor,
    few,
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
    size = stencil.grid.size
    felt = _felt(stencil, cells, base.cells, where)
    for a, steps in enumerate(stencil.steps):
        near = (felt[:, None] - steps[1:]).ravel()
        seeing[near[near // size == a]] = True
    at = np.flatnonzero(seeing & cells.contact)
    if len(at) > PART * cells.count:
        return build(stencil, cells, dtype)

    # New unknowns come last; those that are none any more keep their numbers.
    was, is_now = base.cells.contact.take(where), cells.contact.take(where)
    born, gone = where[~was], where[~is_now]
    n = base.length + len(born)
    number = base.number.copy()
    number[born] = np.arange(base.length, n, dtype=np.int32)

    own = rows_of(stencil, cells, at)
    rows = _with(base.rows, own, at, cells.finest)
    touched = blocks_of(stencil, at) | blocks_of(stencil, gone)
    on_coarse, inverse = aggregated(stencil, cells, rows, touched, base.coarse.cells, KEPT)
    coarse = update(stencil.coarser, on_coarse, dtype, base.coarse)

    G = factor(stencil, cells, own, at, number, n).astype(dtype, copy=False)
    gone = number.take(gone)
    slots = stencil.grid.slots + stencil.grid.origins[touched, None]
    slots = np.concatenate([slots.ravel() + a * size for a in stencil.components])
    again = slots[cells.contact.take(slots)]
    new, places = aggregation(stencil, rows, inverse, again)
    block = np.concatenate([base.block, np.zeros((len(born), places.shape[1]), np.int32)])
    w = np.zeros(block.shape, dtype)
    w[: base.length] = base.W.data.reshape(base.block.shape)
    w[gone] = 0.0
    again = number.take(again)
    w[again], block[again] = new, places
    W = aggregates(w, coarse.number.take(block), coarse.length)
    return Patched(base, cells, number, gone, number.take(at), G, W, coarse)


def _felt(stencil: Stencil, new: Cells, old: Cells, where: Array) -> Array:
    """Return the places in which a change is felt by the unknowns around.

    The rows of G depend on c and d by the correlations c_i T(i-j) c_j / √(d_i d_j).
    """
    if new.finest:
        return where
    zero = np.sqrt(stencil.zero).take(where // stencil.grid.size)
    was, now = (cells.c.take(where) / np.sqrt(cells.d.take(where)) for cells in (old, new))
    return np.asarray(where[np.abs(now - was) * zero > KEPT])


def _with(old: Rows, own: Rows, at: Array, finest: bool) -> Rows:
    """Return the old rows of G with those of the places `at`."""
    place = old.place.copy()
    if finest:
        place[at] = own.place
        return Rows(old.rows, old.sums, place)
    place[at] = own.place + old.rows.shape[1]
    known = np.concatenate([old.rows.T, own.rows.T]).T
    return Rows(known, np.concatenate([old.sums, own.sums], axis=1), place)
