"""Levels of a multilevel sparse approximate inverse: built, or changed from those of another mask.

Small systems are solved again only where one of their cells has changed, and what an aggregate is
on the next level is computed again only where a row of G in it has. G and W are new in the rows of
aggregates from the first that has changed to the last, and copied before and after these. So what
changes in one place costs little on any level. What changes all over the grid renumbers G, and the
coarser a level is, the more of its cells have changed.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor
from scipy.sparse import csr_array

from toeplitz_mg.preconditioners.fsai_apply import Cells, Direct, Level, Rows
from toeplitz_mg.preconditioners.fsai_table import Stencil, block_loads, check, refused

Array = NDArray[Any]

DENSE = 600  # unknowns that are solved for directly
CHUNK = 2048  # blocks that are treated together, in the cache


def build(
    stencil: Stencil, cells: Cells, dtype: np.dtype[Any], old: Level | Direct | None = None
) -> Level | Direct:
    """Build this level and those below.

    Parameters
    ----------
    stencil : Stencil
    cells : Cells
    dtype : dtype
        Of what is applied; everything is computed in float64.
    old : Level or Direct, optional
        The same for another mask: only what differs from there is computed.
    """
    contact = cells.smooth.astype(bool, copy=False)
    at = np.flatnonzero(contact)
    if len(at) <= DENSE:
        return _direct(stencil, cells, at, dtype)
    whole = slice(stencil.origins[0], len(contact))
    if isinstance(old, Level):
        changed = cells.changed_from(old.cells)
        if not changed.any():
            return old
        band = _band(stencil, changed)
        new = band.start + np.flatnonzero(_seeing(stencil, contact, changed, band))
    else:
        old, band, new = None, whole, at
    if cells.finest:
        rows = _rows_by_pattern(stencil, contact, band, old)
    else:
        rows = _rows_by_unknown(stencil, cells, at, new, old)
    on_coarse = _aggregated(stencil, cells, contact, rows, new, old)
    if old is None or 2 * np.count_nonzero(contact[band]) > len(at):
        band = whole  # to copy what is outside of it would take longer
    lines = slice(*at.searchsorted([band.start, band.stop]))
    G = _factor(stencil, cells, rows, at, band).astype(dtype, copy=False)
    W = _aggregation(stencil, rows, on_coarse, at[lines]).astype(dtype, copy=False)
    if old is not None and band != whole:
        G = _spliced(old.G, G, lines, len(at))
        W = _spliced(old.W, W, lines, len(at))
    coarse = build(stencil.coarser, on_coarse, dtype, None if old is None else old.coarse)
    return Level(cells, rows, G, W, coarse)


def _band(stencil: Stencil, changed: Array) -> slice:
    """Return the cells of those rows of blocks in which a row of G or an aggregate may change."""
    where = np.flatnonzero(changed)
    origin, size = stencil.origins[0], stencil.band
    first = (where[0] - origin) // size
    last = (where[-1] - stencil.steps.min() - origin) // size  # which sees the last that changed
    return slice(origin + first * size, min(origin + (last + 1) * size, len(changed)))


def _seeing(stencil: Stencil, contact: Array, changed: Array, band: slice) -> Array:
    """Return where in a band a cell, or one of those in its row of G, has changed."""
    seeing = changed[band].copy()
    for step in stencil.steps[1:]:
        seeing |= changed[band.start + step : band.stop + step]
    return seeing & contact[band] | changed[band]


def _patterns(stencil: Stencil, contact: Array, band: slice) -> Array:
    """Return for each cell of a band its place in `Stencil.table`."""
    low = stencil.steps.min()
    neighbour = contact[band.start + low : band.stop].astype(np.int16)
    pattern = np.zeros(band.stop - band.start, np.int16)
    for shift in (stencil.steps[:0:-1] - low).tolist():
        pattern += pattern
        pattern |= neighbour[shift : shift + len(pattern)]
    return pattern


def _rows_by_pattern(stencil: Stencil, contact: Array, band: slice, old: Level | None) -> Rows:
    place = np.zeros(len(contact), np.int16) if old is None else old.rows.place.copy()
    place[band] = _patterns(stencil, contact, band)
    return Rows(stencil.table, stencil.table_sums, place)


def _rows_by_unknown(
    stencil: Stencil, cells: Cells, at: Array, new: Array, old: Level | None
) -> Rows:
    place = np.zeros(len(cells.c), np.int32)
    place[at] = np.arange(len(at), dtype=np.int32)
    if old is None:
        rows, smooth = np.empty((len(at), len(stencil.steps))), np.empty(len(at))
    else:  # of a cell that was not in contact any
        before = old.rows.place.take(at)
        rows, smooth = old.rows.rows.T.take(before, axis=0), old.rows.smooth.take(before)
        new = new[cells.smooth[new] != 0.0]
    for part in chunks(len(new), 2 * CHUNK):
        near = stencil.steps[:, None] + new[part]
        found = rows_of_G(stencil, cells.c.take(near), cells.d.take(near))
        lines = place.take(new[part])
        rows[lines] = found.T
        smooth[lines] = np.einsum("km,km->m", found, cells.smooth.take(near))
    return Rows(rows.T, smooth, place)


def _aggregated(
    stencil: Stencil, cells: Cells, contact: Array, rows: Rows, new: Array, old: Level | None
) -> Cells:
    """Return the cells of E, anew for blocks in which there are cells `new`."""
    coarser = stencil.coarser
    if old is None:
        m = coarser.padded[0] * coarser.padded[1]
        c, d, smooth = np.zeros(m), np.ones(m), np.zeros(m)
    else:
        below = old.coarse.cells
        c, d, smooth = below.c.copy(), below.d.copy(), below.smooth.copy()
    touched = np.zeros(len(stencil.origins), bool)
    touched[stencil.block_of.take(new)] = True
    blocks = np.flatnonzero(touched)
    for part in chunks(len(blocks)):
        J = blocks[part]
        slots = stencil.slots[:, None] + stencil.origins[J]
        within, place = contact.take(slots), rows.place.take(slots).astype(np.intp, copy=False)
        u = rows.smooth.take(place) * within
        norm = np.sqrt(np.einsum("im,im->m", u, u))
        # No contact any more: the load is 0, the diagonal 1.
        empty = np.logical_not(within.any(axis=0))
        check("the norm of a vector of W is", (norm + empty).min(), stencil)
        u /= norm + empty
        J = coarser.inside[J]
        smooth[J] = norm
        if cells.finest:  # what is exact in full contact need not be computed
            full = (within & (place == rows.rows.shape[1] - 1)).all(axis=0)
            c[J[full]], d[J[full]] = 1.0, coarser.T[0, 0]
            if full.any():
                slots, place, u = (a.compress(~full, axis=1) for a in (slots, place, u))
                J, empty = J[~full], empty[~full]
        loads = block_loads(stencil, rows.rows, place, u)
        c[J], d[J] = _on_coarse(stencil, cells, slots[0], loads)
        d[J[empty]] = 1.0
    return Cells(c, d, smooth)


def _on_coarse(stencil: Stencil, cells: Cells, origins: Array, loads: Array) -> tuple[Array, Array]:
    """Return c and the diagonal d of E for these blocks, exactly, from their loads Gᵀ w."""
    own: Any = 0.0
    if not cells.finest:
        window = stencil.window[:, None] + origins
        c = cells.c[window]
        own = (loads**2 * (cells.d[window] - stencil.T[0, 0] * c**2)).sum(axis=0)
        loads = loads * c
    own = own + ((stencil.own @ loads) * loads).sum(axis=0)
    return loads.sum(axis=0) / stencil.full_load.sum(), own


def _factor(stencil: Stencil, cells: Cells, rows: Rows, at: Array, band: slice) -> csr_array:
    """Return the rows of G in a band."""
    low = band.start + stencil.steps.min()
    before, start, stop = at.searchsorted([low, band.start, band.stop])
    number = np.zeros(band.stop - low, np.int32)
    number[at[before:stop] - low] = np.arange(before, stop, dtype=np.int32)
    if cells.finest:
        G = stencil.sparse_table[rows.place.take(at[start:stop])]
    else:
        G = stencil.sparse(rows.rows.T[start:stop])
    first = (at[start:stop] - band.start).astype(np.int32)  # from `low` to the first it might see
    for part in chunks(len(first), 4 * CHUNK):
        starts = G.indptr[part.start : part.stop + 1]
        columns = G.indices[starts[0] : starts[-1]]
        columns += np.repeat(first[part], np.diff(starts))
        number.take(columns, out=columns, mode="clip")
    return csr_array((G.data, G.indices, G.indptr), (len(first), len(at)))


def _aggregation(stencil: Stencil, rows: Rows, on_coarse: Cells, at: Array) -> csr_array:
    """Return the rows of W for the cells `at`."""
    norm = on_coarse.smooth.take(stencil.coarser.inside)
    number = np.cumsum(norm > 0.0, dtype=np.int32)
    block_of = stencil.block_of.take(at)
    w = rows.smooth.take(rows.place.take(at))
    w /= norm.take(block_of)
    column = (number - 1).take(block_of)
    return csr_array((w, column, np.arange(len(at) + 1, dtype=np.int32)), (len(at), number[-1]))


def _spliced(old: csr_array, new: csr_array, lines: slice, n: int) -> csr_array:
    """Return a matrix of n lines, of which some are new, and those before and after the old."""
    after = lines.stop + old.shape[0] - n
    p, q = old.indptr[[lines.start, after]]
    r = p + new.nnz
    entries = np.concatenate([old.data[:p], new.data, old.data[q:]])
    columns = np.concatenate([old.indices[:p], new.indices, old.indices[q:]])
    columns[r:] += new.shape[1] - old.shape[1]
    starts = [old.indptr[: lines.start], new.indptr + p, old.indptr[after + 1 :] + (r - q)]
    return csr_array((entries, columns, np.concatenate(starts)), (n, new.shape[1]))


def rows_of_G(stencil: Stencil, c: Array, d: Array) -> Array:
    """Return rows of G for the matrix c_i T(i-j) c_j with the diagonal d.

    Parameters
    ----------
    stencil : Stencil
    c, d : ndarray of shape (K, m)
        Of a cell and its neighbours; 0 and 1 where they are not in contact.

    Returns
    -------
    ndarray of shape (K, m)
        S⁻¹ e / √(eᵀ S⁻¹ e), S the matrix of these cells and e the first; zero where there is no
        contact.
    """
    # All systems together, entry by entry: much faster than LAPACK, one by one. With C = diag(c)
    # it is C⁻¹ S C⁻¹ that is factorised, which is the kernel's but for its diagonal; that is
    # infinite where there is no contact. The first row and column, of e, are left as they are.
    K = len(c)
    S = np.empty((K, *c.shape))  # on and below the diagonal C⁻¹ S C⁻¹, above it the factors
    absent = c == 0.0
    divisor = c + absent
    added = d / divisor**2 - stencil.T[0, 0]
    added[absent] = np.inf
    for k in range(K - 1, 0, -1):
        row = S[k, : k + 1]
        np.einsum("jm,jim->im", S[k, k + 1 :], S[k + 1 :, : k + 1], out=row)
        np.subtract(stencil.local[k, : k + 1, None], row, out=row)
        row[k] += added[k]
        check("a pivot is", row[k].min(), stencil)
        np.divide(row[:k], row[k], out=S[:k, k])
    coupled = np.einsum("jm,jm->m", S[0, 1:], S[1:, 0])
    pivot = d[0] + c[0] ** 2 * (stencil.local[0, 0] - stencil.T[0, 0] - coupled)
    check("a pivot is", pivot.min(), stencil)
    rows = np.empty(c.shape)
    rows[0] = c[0] / np.sqrt(pivot)
    for k in range(1, K):
        rows[k] = -np.einsum("jm,jm->m", S[:k, k], rows[:k])
    rows /= divisor
    rows[0] = 1.0 / np.sqrt(pivot)
    return rows


def _direct(stencil: Stencil, cells: Cells, at: Array, dtype: np.dtype[Any]) -> Direct:
    i, j = np.divmod(at, stencil.padded[1])
    E = stencil.T.take(np.abs(i[:, None] - i) * stencil.T.shape[1] + np.abs(j[:, None] - j))
    c = cells.c[at]
    E *= c
    E *= c[:, None]
    np.fill_diagonal(E, cells.d[at])
    try:
        factor, _ = cho_factor(E)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(E)[0])
        raise refused("an eigenvalue of the coarsest matrix is", smallest, stencil) from None
    return Direct(cells, factor.astype(dtype))


def chunks(m: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut range(m) into slices."""
    return (slice(k, min(k + size, m)) for k in range(0, m, size))
